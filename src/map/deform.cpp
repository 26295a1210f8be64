// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/deform.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn {
namespace {

// Keyframes of adjacent submaps that take part: about twice the range below, so that both sides of a border blend the
// same keyframes.
constexpr std::size_t kNeighborKeyframes = 30;
constexpr double kViewAngleScale = 0.4;  // rad from the optical axis: angular scale of a keyframe's weight
constexpr double kRangeScale = 1.5;      // m, the same along the viewing ray
constexpr double kPoseTolerance = 1e-6;  // m, rad

}  // namespace

std::vector<std::size_t> Deformation::keyframes_of(const Atlas& atlas, std::size_t submap) {
  const auto& keyframes = atlas.keyframes;
  std::vector<bool> is_included(keyframes.size(), false);
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    if (keyframes[k].submap != submap) continue;
    is_included[k] = true;
    for (std::size_t n = k; n + kNeighborKeyframes > k && keyframes[n].follows; --n) is_included[n - 1] = true;
    for (std::size_t n = k + 1; n <= k + kNeighborKeyframes && n < keyframes.size() && keyframes[n].follows; ++n)
      is_included[n] = true;
  }
  std::vector<std::size_t> included;
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    if (is_included[k]) included.push_back(k);
  return included;
}

Deformation::Deformation(const Atlas& atlas, std::size_t submap) {
  for (const std::size_t k : keyframes_of(atlas, submap)) {
    const Eigen::Isometry3d& camera = atlas.keyframes[k].submap_from_camera;
    const Eigen::Isometry3d move = atlas.correction(k);
    controls_.push_back({.center = camera.translation(),
                         .forward = camera.linear().col(2),
                         .rotation = Eigen::Quaterniond(move.linear()),
                         .move = move});
    is_rigid_ = is_rigid_ && move.isApprox(controls_.front().move, kPoseTolerance);
    if (controls_.back().rotation.dot(controls_.front().rotation) < 0) controls_.back().rotation.coeffs() *= -1;
  }
}

Eigen::Isometry3d Deformation::operator()(const Eigen::Vector3d& point) const {
  if (is_rigid_) return controls_.front().move;
  // Normalized squared distance of the point from a keyframe's view.
  const auto squared_distance = [&](const Control& c) {
    const Eigen::Vector3d ray = point - c.center;
    const double range = ray.norm(),
                 squared_angle = 2 * (1 - ray.dot(c.forward) / std::max(range, 1e-6));  // about angle^2
    return squared_angle / (kViewAngleScale * kViewAngleScale) + range * range / (kRangeScale * kRangeScale);
  };
  double min_squared = std::numeric_limits<double>::infinity();
  for (const Control& c : controls_) min_squared = std::min(min_squared, squared_distance(c));
  double sum = 0;
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  Eigen::Vector3d moved_sum = Eigen::Vector3d::Zero();
  for (const Control& c : controls_) {
    const double w = std::exp(min_squared - squared_distance(c));
    sum += w;
    rotation += w * c.rotation.coeffs();
    moved_sum += w * (c.move * point);
  }
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.linear() = Eigen::Quaterniond(rotation.normalized()).toRotationMatrix();
  t.translation() = moved_sum / sum - t.linear() * point;
  return t;
}

}  // namespace cairn
