// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "alignment/align.hpp"
#include "geometry/device_drift.hpp"

namespace cairn {

/// First frame of a window of motion, in which the device is compared with tracking.
struct DeviceWindow {
  double timestamp = 0;
  Eigen::Isometry3d device = Eigen::Isometry3d::Identity(), tracked = Eigen::Isometry3d::Identity();
};

/// Pose of a fused frame: by alignment alone, with the error common to all points, and whether the device contradicts
/// it.
struct AlignedPose {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  PoseSigma common_error;
  bool contradicts_device = false;
};

/// Device poses as measurements of the camera's motion. The drift is estimated from windows of motion in which the
/// device is compared with the tracked poses; the median rejects single jumps.
struct DeviceOdometry {
  std::optional<DeviceWindow> window;  // first frame of the current window
  std::vector<DeviceDrift> windows;    // errors of the last windows as shares of their motion, newest last

  int contradictions = 0;  // consecutive frames with a contradiction

  /// Adds a fused frame and the device's pose in its own world. A frame without a device pose ends the window.
  void add(double timestamp, const std::optional<Eigen::Isometry3d>& device, const AlignedPose& aligned);
  /// True if the drift is estimated.
  [[nodiscard]] bool is_known() const;
  /// Estimated drift, at first a typical one; none if the device contradicts tracking.
  [[nodiscard]] std::optional<DeviceDrift> drift() const;
};

/// Fuses an alignment with a pose predicted by the device (Kalman update). `common_error`: of the alignment, from depth
/// errors common to all points. Returns false, without a change, if both contradict each other.
bool fuse_device_pose(const Eigen::Isometry3d& predicted, const Matrix6d& covariance, const PoseSigma& common_error,
                      Alignment& alignment);

}  // namespace cairn
