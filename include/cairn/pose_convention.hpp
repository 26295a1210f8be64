// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Conventions of camera poses.
#pragma once
#include <Eigen/Core>
#include <string>
#include <string_view>

#include "cairn/trajectory.hpp"

namespace cairn {

/// How the numbers of a trajectory are meant. The default is the program's own convention.
struct PoseConvention {
  bool quaternion_w_first = false;  ///< the four numbers of a rotation are qw qx qy qz
  bool camera_from_world = false;   ///< the inverse of a camera's pose
  /// Columns: right, down and forward in the poses' own camera axes, a signed permutation. With determinant -1 the
  /// poses' world is mirrored, too (left-handed).
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  double scale = 1.0;  ///< meters per unit of translation
  double clock = 0.0;  ///< seconds to add to the timestamps

  friend bool operator==(const PoseConvention&, const PoseConvention&) = default;
};

/// Parses `camera_from_world`, `wxyz`, `opengl`, `ros`, `unity`, `axes=RIGHT,DOWN,FORWARD` (as x,-y,-z), `mm`, `cm`,
/// `ft`, `km`, `scale=METRES`, `clock=SECONDS`, joined by commas. Throws std::runtime_error naming the part that is
/// none of these.
[[nodiscard]] PoseConvention pose_convention(std::string_view text);
/// The same text; empty for the program's own convention.
[[nodiscard]] std::string name_of(const PoseConvention& convention);
/// World_from_camera, meters and the frames' clock of poses that were read in the program's own convention.
[[nodiscard]] Trajectory with_convention(Trajectory as_read, const PoseConvention& convention);

}  // namespace cairn
