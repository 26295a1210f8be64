// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <numbers>
#include <set>

#include "cairn/evaluation.hpp"

namespace cairn {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kRightShift = 0.1, kRightTurn = 5 * kDegree;       // meters, radians
constexpr double kRevisitShift = 0.5, kRevisitTurn = 25 * kDegree;  // meters, radians

bool is_within(const Eigen::Isometry3d& motion, double shift, double turn) {
  return motion.translation().norm() < shift && Eigen::AngleAxisd(motion.linear()).angle() < turn;
}

}  // namespace

LoopError evaluate_loops(const std::vector<LoopMeasured>& loops, const std::vector<std::pair<double, int>>& keyframes,
                         const Trajectory& truth, double max_time_difference) {
  const auto at = [&](double time) { return pose_at(truth, time, max_time_difference); };
  LoopError error;
  std::set<double> found;
  for (const LoopMeasured& loop : loops) {
    const auto from = at(loop.from), to = at(loop.to);
    if (!from || !to) continue;
    ++error.loops;
    if (!is_within((from->inverse() * *to).inverse() * loop.i_from_j, kRightShift, kRightTurn)) continue;
    ++error.right;
    found.insert(loop.to);
  }
  std::vector<std::optional<Eigen::Isometry3d>> poses;
  poses.reserve(keyframes.size());
  for (const auto& [time, searched] : keyframes) poses.push_back(at(time));
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    const auto searched = std::min(static_cast<std::size_t>(std::max(0, keyframes[k].second)), k);
    const auto sees_the_same = [&](const std::optional<Eigen::Isometry3d>& pose) {
      return pose && is_within(pose->inverse() * *poses[k], kRevisitShift, kRevisitTurn);
    };
    const auto end = poses.begin() + static_cast<std::ptrdiff_t>(searched);
    if (!poses[k] || std::none_of(poses.begin(), end, sees_the_same)) continue;
    ++error.revisits;
    error.found += found.contains(keyframes[k].first);
  }
  return error;
}

}  // namespace cairn
