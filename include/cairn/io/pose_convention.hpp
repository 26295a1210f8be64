// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Conventions of camera poses.
#pragma once
#include <Eigen/Core>
#include <string>
#include <string_view>

#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Interpretation of the numbers in a trajectory file. The default is Cairn's own convention.
struct PoseConvention {
  bool quaternion_w_first = false;  ///< quaternions as qw qx qy qz
  bool camera_from_world = false;   ///< poses are camera_from_world
  /// Columns: right, down and forward in the camera axes of the poses, a signed permutation. Determinant -1 also
  /// mirrors the world of the poses (left-handed).
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  double scale = 1.0;  ///< meters per unit of translation
  double clock = 0.0;  ///< seconds to add to the timestamps

  friend bool operator==(const PoseConvention&, const PoseConvention&) = default;
};

/// Parses `camera_from_world`, `wxyz`, `opengl`, `ros`, `unity`, `axes=RIGHT,DOWN,FORWARD` (as x,-y,-z), `mm`, `cm`,
/// `ft`, `km`, `scale=METERS`, `clock=SECONDS`, separated by commas. Throws std::runtime_error naming an unknown item.
[[nodiscard]] PoseConvention pose_convention(std::string_view text);
/// Text for pose_convention(); empty for Cairn's own convention.
[[nodiscard]] std::string to_string(const PoseConvention& convention);
/// Converts poses read in Cairn's own convention to world_from_camera, meters and the frames' clock.
[[nodiscard]] Trajectory with_convention(Trajectory as_read, const PoseConvention& convention);

}  // namespace cairn
