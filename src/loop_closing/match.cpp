// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "loop_closing/match.hpp"

#include "geometry/readout.hpp"

namespace cairn {
namespace {

constexpr double kMinInliers = 0.4, kMinOverlap = 0.3, kMaxRmse = 2.0;
// Rad, m: max. difference between both directions.
constexpr double kMaxRotationDifference = 0.02, kMaxTranslationDifference = 0.02;

}  // namespace

SurfaceMatcher::SurfaceMatcher(gpu::Device& device, const Rig& rig, const Options& options)
    : first_(device, with_global_shutter({rig.depth, rig.sensor}), options.surface, options.track.levels,
             options.track.finest_level),
      second_(device, with_global_shutter({rig.depth, rig.sensor}), options.surface, options.track.levels,
              options.track.finest_level),
      aligner_(device, options.track, rig.sensor) {}

void SurfaceMatcher::set_reference(const Frame& reference) { view_.levels = first_.preprocess(reference).levels; }

std::optional<Match> SurfaceMatcher::match(const Frame& query, const Eigen::Isometry3d& guess) {
  const Alignment a = aligner_.align(second_.preprocess(query), view_, guess);
  if (!a.converged() || a.fit.inlier_share < kMinInliers || a.fit.overlap < kMinOverlap || a.fit.rmse > kMaxRmse ||
      a.fit.unobserved > 0)
    return std::nullopt;
  // The alignment's information is for motions in the frame of the reference.
  const Matrix6d reference_by_query = adjoint(a.submap_from_camera);
  return Match{.reference_from_query = a.submap_from_camera,
               .information = inflate_information(reference_by_query.transpose() * a.information * reference_by_query),
               .inlier_share = a.fit.inlier_share,
               .rmse = a.fit.rmse};
}

std::optional<Match> SurfaceMatcher::match_symmetric(const Frame& reference, const Frame& query,
                                                     const Eigen::Isometry3d& guess) {
  set_reference(reference);
  auto forward = match(query, guess);
  if (!forward) return std::nullopt;
  set_reference(query);
  const auto backward = match(reference, forward->reference_from_query.inverse());
  if (!backward) return std::nullopt;
  const Eigen::Isometry3d round_trip = forward->reference_from_query * backward->reference_from_query;
  if (round_trip.translation().norm() > kMaxTranslationDifference ||
      Eigen::AngleAxisd(round_trip.linear()).angle() > kMaxRotationDifference)
    return std::nullopt;
  return forward;
}

}  // namespace cairn
