// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <random>
#include <stdexcept>

#include "cairn/evaluation.hpp"
#include "eval/mesh_surface.hpp"
#include "eval/statistics.hpp"

namespace cairn {
namespace {

/// Points spread evenly by area: one in each of `count` strata of the cumulated area.
std::vector<Eigen::Vector3f> sample(const Mesh& mesh, int count) {
  std::vector<double> cumulated;
  double area = 0;
  for (const auto& t : mesh.triangles) {
    area +=
        0.5 * (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm();
    cumulated.push_back(area);
  }
  if (!(area > 0)) throw std::runtime_error("the mesh has no surface to evaluate");
  std::mt19937_64 random(1);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1.0p-53; };
  std::vector<Eigen::Vector3f> points;
  std::size_t i = 0;
  for (int k = 0; k < count; ++k) {
    const double at = area * (k + uniform()) / count;
    while (i + 1 < cumulated.size() && cumulated[i] < at) ++i;
    const auto& t = mesh.triangles[i];
    const double u = std::sqrt(uniform()), v = uniform();  // Osada et al. 2002, eq. 1
    points.emplace_back(static_cast<float>(1 - u) * mesh.positions[t[0]] +
                        static_cast<float>(u * (1 - v)) * mesh.positions[t[1]] +
                        static_cast<float>(u * v) * mesh.positions[t[2]]);
  }
  return points;
}

std::vector<double> distances(const std::vector<Eigen::Vector3f>& points, const MeshSurface& surface) {
  std::vector<double> d(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) { d[i] = surface.distance(points[i]); });
  return d;
}

double share_within(const std::vector<double>& d, double threshold) {
  return static_cast<double>(std::count_if(d.begin(), d.end(), [&](double x) { return x <= threshold; })) /
         static_cast<double>(d.size());
}

}  // namespace

MeshError evaluate_mesh(const Mesh& estimate, const Mesh& truth, int samples, const Mesh* seen) {
  if (samples < 1) throw std::runtime_error("the number of samples must be positive");
  const auto of_estimate = distances(sample(estimate, samples), MeshSurface(truth));
  const auto of_truth = distances(sample(seen != nullptr ? *seen : truth, samples), MeshSurface(estimate));
  MeshError error{.accuracy = statistics(of_estimate), .completeness = statistics(of_truth)};
  constexpr std::array kThresholds{0.01, 0.02, 0.05};
  for (std::size_t i = 0; i < kThresholds.size(); ++i) {
    const double precision = share_within(of_estimate, kThresholds[i]), recall = share_within(of_truth, kThresholds[i]);
    const double sum = precision + recall;
    error.at[i] = {kThresholds[i], precision, recall, sum > 0 ? 2 * precision * recall / sum : 0.0};
  }
  return error;
}

ErrorStatistics evaluate_seam(const Mesh& first, const Mesh& second, double reach, int samples) {
  if (first.triangles.empty() || second.triangles.empty()) return {};
  auto found = distances(sample(first, samples), MeshSurface(second));
  std::erase_if(found, [&](double d) { return d >= reach; });
  return found.empty() ? ErrorStatistics{} : statistics(found);
}

}  // namespace cairn
