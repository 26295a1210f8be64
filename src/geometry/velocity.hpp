// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/mapping/pose.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Velocity of the camera in its own frame, rad/s and m/s: mean over a few frames. Zero in a gap of the trajectory.
[[nodiscard]] inline Vector6d velocity_at(const Trajectory& poses, double timestamp) {
  constexpr double kStep = 0.03, kMaxGap = 0.1;  // seconds
  const auto before = pose_at(poses, timestamp - kStep, kMaxGap), after = pose_at(poses, timestamp + kStep, kMaxGap);
  if (!before || !after) return Vector6d::Zero();
  return local_coordinates(before->inverse() * *after) / (2 * kStep);
}

/// Motion of a camera in its own frame around a time: retract(after(s)) is the motion after s seconds, accurate up to
/// the third order in s.
struct CameraMotion {
  Vector6d velocity = Vector6d::Zero(), acceleration = Vector6d::Zero();  // rad/s and m/s; rad/s^2 and m/s^2
  [[nodiscard]] Vector6d after(double seconds) const {
    return seconds * velocity + 0.5 * seconds * seconds * acceleration;
  }
};

/// Estimates motion; accelerations use more frames than velocities because noise affects them more. Zero in a gap of
/// the trajectory.
[[nodiscard]] inline CameraMotion motion_at(const Trajectory& poses, double timestamp) {
  constexpr double kStep = 0.06, kMaxGap = 0.1;  // seconds
  CameraMotion motion{.velocity = velocity_at(poses, timestamp)};
  const auto before = pose_at(poses, timestamp - kStep, kMaxGap), now = pose_at(poses, timestamp, kMaxGap),
             after = pose_at(poses, timestamp + kStep, kMaxGap);
  if (before && now && after)
    motion.acceleration =
        (local_coordinates(now->inverse() * *after) - local_coordinates(before->inverse() * *now)) / (kStep * kStep);
  return motion;
}

}  // namespace cairn
