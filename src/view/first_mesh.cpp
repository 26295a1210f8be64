// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/first_mesh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <sstream>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "mesh/colored_parts.hpp"
#include "mesh/gltf.hpp"
#include "mesh/topology.hpp"
#include "view/downloads.hpp"

namespace cairn {
namespace {

constexpr float kTrianglesPerCell = 2.4f;  // mean number of surface triangles per occupied cell

float area_of(const Mesh& mesh) {
  double area = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    area += static_cast<double>(
        (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).norm() / 2);
  return static_cast<float>(area);
}

/// Cell index of each vertex, numbered by first occurrence.
std::pair<std::vector<std::uint32_t>, std::size_t> cells_of(const Mesh& mesh, float size) {
  std::unordered_map<std::uint64_t, std::uint32_t> cells;
  std::vector<std::uint32_t> cell_of;
  cell_of.reserve(mesh.positions.size());
  for (const Eigen::Vector3f& p : mesh.positions) {
    std::uint64_t key = 0;
    for (const float x : p)
      key = key << 21 | (static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x / size))) & 0x1fffff);
    cell_of.push_back(cells.try_emplace(key, static_cast<std::uint32_t>(cells.size())).first->second);
  }
  return {std::move(cell_of), cells.size()};
}

Mesh clustered(const Mesh& mesh, float size) {
  const auto [cell_of, count] = cells_of(mesh, size);
  std::vector<Eigen::Vector3f> centers(count, Eigen::Vector3f::Zero()), colors(count, Eigen::Vector3f::Zero());
  std::vector<float> members(count, 0);
  for (std::size_t v = 0; v < cell_of.size(); ++v) {
    centers[cell_of[v]] += mesh.positions[v];
    members[cell_of[v]] += 1;
    if (mesh.colors.empty()) continue;
    const auto& [r, g, b, a] = mesh.colors[v];
    colors[cell_of[v]] += Eigen::Vector3f(r, g, b);
  }
  Mesh coarse;
  for (std::size_t c = 0; c < count; ++c) {
    coarse.positions.emplace_back(centers[c] / members[c]);
    if (mesh.colors.empty()) continue;
    const auto byte = [&](int i) { return static_cast<std::uint8_t>(std::lround(colors[c][i] / members[c])); };
    coarse.colors.push_back({byte(0), byte(1), byte(2), 255});
  }
  for (const auto& t : mesh.triangles) {
    std::array<std::uint32_t, 3> moved{cell_of[t[0]], cell_of[t[1]], cell_of[t[2]]};
    if (moved[0] == moved[1] || moved[1] == moved[2] || moved[2] == moved[0]) continue;
    std::rotate(moved.begin(), std::min_element(moved.begin(), moved.end()), moved.end());
    coarse.triangles.push_back(moved);
  }
  std::sort(coarse.triangles.begin(), coarse.triangles.end());
  coarse.triangles.erase(std::unique(coarse.triangles.begin(), coarse.triangles.end()), coarse.triangles.end());
  return coarse;
}

}  // namespace

std::string first_mesh(const std::filesystem::path& file, std::size_t triangles) {
  Mesh mesh = joined(colored_parts(file));
  if (mesh.triangles.size() > triangles)
    mesh = clustered(mesh, std::sqrt(kTrianglesPerCell * area_of(mesh) / static_cast<float>(triangles)));
  mesh.normals.clear();
  GltfOptions options;
  options.compression = Compression::meshopt;
  GltfWriter writer(options);
  writer.add("first", mesh);
  std::ostringstream out;
  writer.put(out);
  return std::move(out).str();
}

Served served_first_mesh(const std::filesystem::path& file) {
  return {.content_type = content_type_of(file),
          .body = beforehand([file]() -> Content { return std::make_shared<const Text>(first_mesh(file)); }),
          .is_packable = true};
}

}  // namespace cairn
