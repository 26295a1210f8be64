// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <numbers>
#include <set>

#include "cairn/eval/evaluation.hpp"

namespace cairn {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMaxTranslationError = 0.1, kMaxRotationError = 5 * kDegree;  // meters, radians
constexpr double kMaxRevisitDistance = 0.5, kMaxRevisitAngle = 25 * kDegree;   // meters, radians

bool is_within(const Eigen::Isometry3d& motion, double max_distance, double max_angle) {
  return motion.translation().norm() < max_distance && Eigen::AngleAxisd(motion.linear()).angle() < max_angle;
}

}  // namespace

LoopError evaluate_loops(const std::vector<MeasuredLoop>& loops, const std::vector<KeyframeInfo>& keyframes,
                         const Trajectory& truth, double max_time_difference) {
  const auto at = [&](double time) { return pose_at(truth, time, max_time_difference); };
  LoopError error;
  std::set<double> found;
  for (const MeasuredLoop& loop : loops) {
    const auto from = at(loop.from), to = at(loop.to);
    if (!from || !to) continue;
    ++error.loops;
    if (!is_within((from->inverse() * *to).inverse() * loop.i_from_j, kMaxTranslationError, kMaxRotationError))
      continue;
    ++error.right;
    found.insert(loop.to);
  }
  std::vector<std::optional<Eigen::Isometry3d>> poses;
  poses.reserve(keyframes.size());
  for (const KeyframeInfo& keyframe : keyframes) poses.push_back(at(keyframe.timestamp));
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    const auto searched = std::min(static_cast<std::size_t>(std::max(0, keyframes[k].searched)), k);
    const auto is_revisit = [&](const std::optional<Eigen::Isometry3d>& pose) {
      return pose && is_within(pose->inverse() * *poses[k], kMaxRevisitDistance, kMaxRevisitAngle);
    };
    const auto end = poses.begin() + static_cast<std::ptrdiff_t>(searched);
    if (!poses[k] || std::none_of(poses.begin(), end, is_revisit)) continue;
    ++error.revisits;
    error.found += found.contains(keyframes[k].timestamp);
  }
  return error;
}

}  // namespace cairn
