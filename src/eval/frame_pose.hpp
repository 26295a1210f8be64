// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>
#include <optional>

#include "cairn/mapping/trajectory.hpp"

namespace cairn {

constexpr double kMaxTimestampDifference = 0.001;  // seconds

/// Pose of the frame at `time`, without interpolation: a lost frame has no pose.
[[nodiscard]] inline std::optional<Eigen::Isometry3d> frame_pose(const Trajectory& poses, double time) {
  const auto next = std::lower_bound(poses.begin(), poses.end(), time - kMaxTimestampDifference,
                                     [](const StampedPose& pose, double t) { return pose.timestamp < t; });
  if (next == poses.end() || next->timestamp > time + kMaxTimestampDifference) return std::nullopt;
  return next->world_from_camera;
}

}  // namespace cairn
