// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <random>
#include <stdexcept>

#include "cairn/eval/evaluation.hpp"
#include "eval/mesh_surface.hpp"
#include "eval/statistics.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

struct Sample {
  Eigen::Vector3f point;
  std::size_t triangle;
};

/// Samples points evenly by area: one in each of `count` strata of the cumulative area.
std::vector<Sample> sample(const Mesh& mesh, int count) {
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
  std::vector<Sample> samples;
  std::size_t i = 0;
  for (int k = 0; k < count; ++k) {
    const double at = area * (k + uniform()) / count;
    while (i + 1 < cumulated.size() && cumulated[i] < at) ++i;
    const auto& t = mesh.triangles[i];
    const double u = std::sqrt(uniform()), v = uniform();  // Osada et al. 2002, eq. 1
    samples.push_back({static_cast<float>(1 - u) * mesh.positions[t[0]] +
                           static_cast<float>(u * (1 - v)) * mesh.positions[t[1]] +
                           static_cast<float>(u * v) * mesh.positions[t[2]],
                       i});
  }
  return samples;
}

std::vector<double> distances(const std::vector<Sample>& samples, const MeshSurface& surface) {
  std::vector<double> d(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t i) { d[i] = surface.distance(samples[i].point); });
  return d;
}

Eigen::Vector3f normal_of(const Mesh& mesh, std::size_t triangle) {
  const auto& t = mesh.triangles[triangle];
  return (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).normalized();
}

/// Boundary edges per triangle, as bits.
std::vector<std::uint8_t> borders_of(const Mesh& mesh) {
  const std::vector<Side> sides = sides_by_edge(mesh, weld(mesh));
  std::vector<std::uint8_t> borders(mesh.triangles.size(), 0);
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if (end == begin + 1) borders[sides[begin].triangle] |= static_cast<std::uint8_t>(1u << sides[begin].corner);
  });
  return borders;
}

/// Returns true if a point is on one of the given boundary edges of a triangle.
bool is_on_border(const Mesh& mesh, std::size_t triangle, std::uint8_t borders, const Eigen::Vector3f& point) {
  constexpr float kMaxDistance = 1e-5f;  // meters
  const auto& t = mesh.triangles[triangle];
  for (std::size_t corner = 0; corner < 3; ++corner) {
    if ((borders >> corner & 1) == 0) continue;
    const Eigen::Vector3f &a = mesh.positions[t[corner]], &b = mesh.positions[t[(corner + 1) % 3]];
    if (from_triangle(point, a, b, b).norm() < kMaxDistance) return true;
  }
  return false;
}

double fraction_within(const std::vector<double>& d, double threshold) {
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
    const double precision = fraction_within(of_estimate, kThresholds[i]),
                 recall = fraction_within(of_truth, kThresholds[i]);
    const double sum = precision + recall;
    error.at[i] = {kThresholds[i], precision, recall, sum > 0 ? 2 * precision * recall / sum : 0.0};
  }
  return error;
}

ErrorStatistics evaluate_seam(const Mesh& first, const Mesh& second, double reach, int samples) {
  if (first.triangles.empty() || second.triangles.empty()) return {};
  constexpr float kMinNormalCosine = 0.5f;  // cosine between normals
  const std::vector<Sample> points = sample(first, samples);
  const MeshSurface surface(second);
  const std::vector<std::uint8_t> borders = borders_of(second);
  std::vector<double> gaps(points.size(), reach);
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    const auto& [point, triangle] = points[i];
    const MeshSurface::Nearest nearest = surface.nearest(point);
    if (normal_of(first, triangle).dot(normal_of(second, nearest.triangle)) < kMinNormalCosine) return;
    const auto& t = second.triangles[nearest.triangle];
    const Eigen::Vector3f nearest_point =
        point - from_triangle(point, second.positions[t[0]], second.positions[t[1]], second.positions[t[2]]);
    if (borders[nearest.triangle] != 0 &&
        is_on_border(second, nearest.triangle, borders[nearest.triangle], nearest_point))
      return;
    gaps[i] = std::sqrt(static_cast<double>(nearest.squared_distance));
  });
  std::erase_if(gaps, [&](double d) { return d >= reach; });
  return gaps.empty() ? ErrorStatistics{} : statistics(gaps);
}

}  // namespace cairn
