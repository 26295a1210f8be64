// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Comparison of a tracked trajectory with the poses of the recording's device.
#pragma once
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Agreement of relative motions over time windows.
struct PoseAgreement {
  int windows = 0;             // 0: no comparison possible
  double beyond = 0;           // share of the windows in which the difference exceeds the drift of both
  double shift = 0, turn = 0;  // meters and radians, between the first and the last time with both poses
  double allowed_shift = 0, allowed_turn = 0;  // limits of shift and turn
  int scaled_windows = 0;                      // windows with sufficient motion for a ratio of lengths
  double scale = 1;                            // median ratio of the tracked distance to the device's distance
  double allowed_scale = 0;                    // limit for the deviation from 1
  double scale_spread = 0;                     // median absolute deviation of the ratios
};

/// Compares trajectories with a common clock; their worlds may differ. Interpolates device poses over gaps of at most
/// 0.1 s. `drift`: the device's drift relative to visual-inertial odometry.
[[nodiscard]] PoseAgreement compare_poses(const Trajectory& tracked, const Trajectory& device, double drift = 1);

}  // namespace cairn
