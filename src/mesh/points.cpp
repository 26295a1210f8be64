// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/points.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace cairn {

void SurfacePoints::add(const Mesh& mesh) {
  // Samples at a third of the spacing; keeps the sample closest to the center of each cube.
  struct Sample {
    float distance;
    std::uint32_t triangle;
    float b, c;
  };
  std::map<std::tuple<int, int, int>, Sample> best;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Eigen::Vector3f &p = mesh.positions[i], ab = mesh.positions[j] - p, ac = mesh.positions[k] - p;
    const int n = 1 + static_cast<int>(3 * std::max({ab.norm(), ac.norm(), (ac - ab).norm()}) / spacing_);
    for (int u = 0; u < n; ++u)
      for (int v = 0; u + v < n; ++v) {
        const float b = (static_cast<float>(u) + 1.0f / 3) / static_cast<float>(n),
                    c = (static_cast<float>(v) + 1.0f / 3) / static_cast<float>(n);
        const Eigen::Vector3f at = p + b * ab + c * ac;
        const Eigen::Vector3i cube = (at / spacing_).array().floor().cast<int>();
        const float distance = (at / spacing_ - cube.cast<float>() - Eigen::Vector3f::Constant(0.5f)).squaredNorm();
        const auto [it, is_new] = best.try_emplace({cube.x(), cube.y(), cube.z()}, Sample{distance, t, b, c});
        if (!is_new && distance < it->second.distance) it->second = {distance, t, b, c};
      }
  }
  for (const auto& [cube, s] : best) {
    if (!taken_.insert({std::get<0>(cube), std::get<1>(cube), std::get<2>(cube)}).second) continue;
    const auto& t = mesh.triangles[s.triangle];
    const float a = 1 - s.b - s.c;
    points_.positions.push_back(a * mesh.positions[t[0]] + s.b * mesh.positions[t[1]] + s.c * mesh.positions[t[2]]);
    if (!mesh.normals.empty())
      points_.normals.push_back(
          (a * mesh.normals[t[0]] + s.b * mesh.normals[t[1]] + s.c * mesh.normals[t[2]]).normalized());
    if (!mesh.sigmas.empty())
      points_.sigmas.push_back(a * mesh.sigmas[t[0]] + s.b * mesh.sigmas[t[1]] + s.c * mesh.sigmas[t[2]]);
    if (mesh.colors.empty()) continue;
    auto& color = points_.colors.emplace_back();
    for (std::size_t channel = 0; channel < 3; ++channel)
      color[channel] = static_cast<std::uint8_t>(std::lround(
          a * mesh.colors[t[0]][channel] + s.b * mesh.colors[t[1]][channel] + s.c * mesh.colors[t[2]][channel]));
    color[3] = 255;
  }
}

}  // namespace cairn
