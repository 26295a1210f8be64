// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>

namespace cairn {

/// Turns what an iPhone or iPad measures into its camera's frame. Core Motion has x to the right and y up in portrait,
/// z out of the screen; the images' x points from the front camera to the other end of the device, their y to the left.
[[nodiscard]] inline Eigen::Quaterniond camera_from_phone() {
  return Eigen::Quaterniond((Eigen::Matrix3d() << 0, -1, 0, -1, 0, 0, 0, 0, -1).finished());
}

}  // namespace cairn
