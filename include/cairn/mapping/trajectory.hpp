// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <vector>

namespace cairn {

struct StampedPose {
  double timestamp = 0.0;  ///< seconds
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
};

/// Poses with increasing timestamps.
using Trajectory = std::vector<StampedPose>;

/// Reads the TUM format: one `timestamp tx ty tz qx qy qz qw` per line, `#` starts a comment. Sorts by time. Throws
/// std::runtime_error with file and line number for a malformed line, NaN, a zero quaternion or an empty file.
[[nodiscard]] Trajectory read_trajectory(const std::filesystem::path& file);

/// Writes the TUM format atomically.
void write_trajectory(const std::filesystem::path& file, const Trajectory& trajectory);

/// Pose at a time, interpolated (slerp) between neighbors at most `max_gap` seconds from each other; else nullopt.
[[nodiscard]] std::optional<Eigen::Isometry3d> pose_at(const Trajectory& trajectory, double timestamp,
                                                       double max_gap = 0.1);

}  // namespace cairn
