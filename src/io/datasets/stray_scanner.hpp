// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>

namespace cairn {

/// Returns the rotation from an iPhone's or iPad's IMU frame to its camera frame. Core Motion has x right and y up in
/// portrait, z out of the screen; image x points from the front camera to the opposite end of the device, image y to
/// the left.
[[nodiscard]] inline Eigen::Quaterniond camera_from_phone() {
  return Eigen::Quaterniond((Eigen::Matrix3d() << 0, -1, 0, -1, 0, 0, 0, 0, -1).finished());
}

}  // namespace cairn
