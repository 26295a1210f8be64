// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/pose.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// Of the camera in its own frame, rad/s and m/s: the mean over some frames. Zero where there is a gap.
[[nodiscard]] inline Vector6d velocity_at(const Trajectory& poses, double timestamp) {
  constexpr double kStep = 0.03, kMaxGap = 0.1;  // seconds
  const auto before = pose_at(poses, timestamp - kStep, kMaxGap), after = pose_at(poses, timestamp + kStep, kMaxGap);
  if (!before || !after) return Vector6d::Zero();
  return local_coordinates(before->inverse() * *after) / (2 * kStep);
}

}  // namespace cairn
