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
constexpr std::size_t kNeighbours = 30;
constexpr double kView = 0.4;   // rad from the optical axis: angular scale of a keyframe's weight
constexpr double kRange = 1.5;  // m, the same along the viewing ray
constexpr double kSame = 1e-6;  // m, rad

}  // namespace

std::vector<std::size_t> Deformation::keyframes_of(const Atlas& atlas, std::size_t submap) {
  const auto& keyframes = atlas.keyframes;
  std::vector<bool> takes_part(keyframes.size(), false);
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    if (keyframes[k].submap != submap) continue;
    takes_part[k] = true;
    for (std::size_t n = k; n + kNeighbours > k && keyframes[n].follows; --n) takes_part[n - 1] = true;
    for (std::size_t n = k + 1; n <= k + kNeighbours && n < keyframes.size() && keyframes[n].follows; ++n)
      takes_part[n] = true;
  }
  std::vector<std::size_t> bending;
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    if (takes_part[k]) bending.push_back(k);
  return bending;
}

Deformation::Deformation(const Atlas& atlas, std::size_t submap) {
  for (const std::size_t k : keyframes_of(atlas, submap)) {
    const Eigen::Isometry3d& camera = atlas.keyframes[k].submap_from_camera;
    const Eigen::Isometry3d move = atlas.correction(k);
    controls_.push_back({.centre = camera.translation(),
                         .forward = camera.linear().col(2),
                         .rotation = Eigen::Quaterniond(move.linear()),
                         .move = move});
    is_rigid_ = is_rigid_ && move.isApprox(controls_.front().move, kSame);
    if (controls_.back().rotation.dot(controls_.front().rotation) < 0) controls_.back().rotation.coeffs() *= -1;
  }
}

Eigen::Isometry3d Deformation::operator()(const Eigen::Vector3d& point) const {
  if (is_rigid_) return controls_.front().move;
  // Normalized squared distance of the point from a keyframe's view.
  const auto squared = [&](const Control& c) {
    const Eigen::Vector3d ray = point - c.centre;
    const double range = ray.norm(), aside = 2 * (1 - ray.dot(c.forward) / std::max(range, 1e-6));  // about angle^2
    return aside / (kView * kView) + range * range / (kRange * kRange);
  };
  double least = std::numeric_limits<double>::infinity();
  for (const Control& c : controls_) least = std::min(least, squared(c));
  double sum = 0;
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();
  for (const Control& c : controls_) {
    const double w = std::exp(least - squared(c));
    sum += w;
    rotation += w * c.rotation.coeffs();
    moved += w * (c.move * point);
  }
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.linear() = Eigen::Quaterniond(rotation.normalized()).toRotationMatrix();
  t.translation() = moved / sum - t.linear() * point;
  return t;
}

}  // namespace cairn
