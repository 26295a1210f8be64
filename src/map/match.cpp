// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/match.hpp"

namespace cairn {
namespace {

constexpr double kMinInliers = 0.4, kMinOverlap = 0.3, kMaxRmse = 2.0;
constexpr double kSameTurn = 0.02, kSameDistance = 0.02;   // rad, m: max. difference between both directions
constexpr double kTurnFloor = 0.003, kShiftFloor = 0.004;  // rad, m: errors independent of the number of points
constexpr double kTogether = 100;                          // correlated points that count as one

}  // namespace

Matrix6d calibrated(const Matrix6d& information) {
  Matrix6d covariance = kTogether * (information + 1e-6 * Matrix6d::Identity()).inverse();
  covariance.diagonal().head<3>().array() += kTurnFloor * kTurnFloor;
  covariance.diagonal().tail<3>().array() += kShiftFloor * kShiftFloor;
  return covariance.inverse();
}

SurfaceMatcher::SurfaceMatcher(gpu::Device& device, const Rig& rig, const Options& options)
    : first_(device, at_one_moment({rig.depth, rig.sensor}), options.surface, options.track.levels,
             options.track.finest_level),
      second_(device, at_one_moment({rig.depth, rig.sensor}), options.surface, options.track.levels,
              options.track.finest_level),
      aligner_(device, options.track, rig.sensor) {}

void SurfaceMatcher::set_from(const Frame& from) { view_.levels = first_.preprocess(from).levels; }

std::optional<Match> SurfaceMatcher::match(const Frame& to, const Eigen::Isometry3d& guess) {
  const Alignment a = aligner_.align(second_.preprocess(to), view_, guess);
  if (!a.converged() || a.fit.inlier_share < kMinInliers || a.fit.overlap < kMinOverlap || a.fit.rmse > kMaxRmse ||
      a.fit.unobserved > 0)
    return std::nullopt;
  // The alignment's information is for motions in the frame of `from`.
  const Matrix6d from_to = adjoint(a.submap_from_camera);
  return Match{.i_from_j = a.submap_from_camera,
               .information = calibrated(from_to.transpose() * a.information * from_to),
               .inlier_share = a.fit.inlier_share,
               .rmse = a.fit.rmse};
}

std::optional<Match> SurfaceMatcher::both_ways(const Frame& from, const Frame& to, const Eigen::Isometry3d& guess) {
  set_from(from);
  auto there = match(to, guess);
  if (!there) return std::nullopt;
  set_from(to);
  const auto back = match(from, there->i_from_j.inverse());
  if (!back) return std::nullopt;
  const Eigen::Isometry3d round = there->i_from_j * back->i_from_j;
  if (round.translation().norm() > kSameDistance || Eigen::AngleAxisd(round.linear()).angle() > kSameTurn)
    return std::nullopt;
  return there;
}

}  // namespace cairn
