// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A tracked trajectory against the poses of a device that took the recording.
#pragma once
#include "cairn/trajectory.hpp"

namespace cairn {

/// Relative motions over windows of time.
struct PoseAgreement {
  int windows = 0;             // 0: nothing to compare
  double beyond = 0;           // share of the windows in which the two differ by more than both drift
  double shift = 0, turn = 0;  // meters and radians over all of the recording, or the longest part of it with both
  double allowed_shift = 0, allowed_turn = 0;  // of these
  int scaled_windows = 0;                      // with enough way for a ratio of lengths
  double scale = 1;                            // median of tracked way over the device's
  double allowed_scale = 0;                    // difference from 1
  double scale_spread = 0;                     // half of the ratios lie so far from it, at most
};

/// `tracked` and `device` in the same clock; worlds are their own. Poses of the device count between two that are at
/// most 0.1 s apart. `drift`: of the device, in units of visual-inertial odometry's.
[[nodiscard]] PoseAgreement compare_poses(const Trajectory& tracked, const Trajectory& device, double drift = 1);

}  // namespace cairn
