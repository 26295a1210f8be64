// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "cairn/eval/evaluation.hpp"
#include "eval/mesh_surface.hpp"
#include "eval/statistics.hpp"

namespace cairn {
namespace {

constexpr int kVoxelStride = 4;                  // voxels
constexpr double kMaxSurfaceDifference = 0.002;  // meters
constexpr double kOnSurface = 0.001;             // meters; the sign is not defined within this distance
constexpr double kMinGradient = 0.98;            // minimum gradient length away from the medial axis

struct AtPoint {
  bool counts = false, is_smooth = false;
  double error = 0, angle = 0, truth = 0, distance = 0;
};

}  // namespace

DistanceError evaluate_distances(const DistanceField& field, const Scene& scene, const Mesh& seen) {
  const MeshSurface surface(seen);
  const double voxel = field.voxel_size();
  std::mt19937 random(1);
  std::uniform_real_distribution<float> part(-0.5f, 0.5f);
  std::vector<Eigen::Vector3f> points;
  for (const auto& [block, samples] : field.blocks())
    for (int i = 0; i < 4096; ++i) {
      const Eigen::Vector3f inside(part(random), part(random), part(random));
      if ((i + (i >> 4)) % kVoxelStride != 0 || std::isnan((*samples)[static_cast<std::size_t>(i)])) continue;
      const Eigen::Vector3i v = DistanceField::voxel(block, i);
      points.emplace_back(field.point(v.cast<float>() + inside));
    }
  std::vector<DistanceField::Answer> answers(points.size());
  field.query(points, answers);

  std::vector<AtPoint> at(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    const Eigen::Vector3d p = points[i].cast<double>();
    AtPoint& a = at[i];
    a.truth = scene.distance(p);
    a.distance = answers[i].distance;
    a.counts = answers[i].known && std::abs(a.truth) < field.max_distance() - voxel &&
               std::abs(surface.distance(points[i]) - std::abs(a.truth)) < kMaxSurfaceDifference;
    if (!a.counts) return;
    a.error = std::abs(a.distance - a.truth);
    Eigen::Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 0.5 * voxel * Eigen::Vector3d::Unit(axis);
      gradient[axis] = (scene.distance(p + step) - scene.distance(p - step)) / voxel;
    }
    a.is_smooth = gradient.norm() >= kMinGradient;
    a.angle = std::acos(std::clamp(gradient.normalized().dot(answers[i].gradient.cast<double>()), -1.0, 1.0));
  });

  DistanceError result{.distance = {}, .known = static_cast<int>(points.size())};
  std::vector<double> errors;
  int within = 0;
  for (const AtPoint& a : at) {
    if (std::abs(a.truth) > kOnSurface) {
      ++result.all_signs;
      result.all_right_signs += (a.truth < 0) == (a.distance < 0);
    }
    if (!a.counts) continue;
    errors.push_back(a.error);
    within += a.error < voxel;
    if (std::abs(a.truth) > kOnSurface) {
      ++result.signs;
      result.right_signs += (a.truth < 0) == (a.distance < 0);
    }
    if (a.is_smooth) {
      ++result.gradients;
      result.gradient_mean += a.angle;
    }
  }
  result.gradient_mean /= std::max(1, result.gradients);
  result.within_voxel = static_cast<double>(within) / std::max<double>(1, static_cast<double>(errors.size()));
  result.distance = statistics(std::move(errors));
  return result;
}

}  // namespace cairn
