// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>

namespace cairn {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;  ///< (rotation, translation): radians, meters

/// Rigid transform of a vector: rotation about the first half by its norm, translation by the second half.
[[nodiscard]] Eigen::Isometry3d retract(const Vector6d& x);

/// Inverse of retract, for rotations below 180 degrees.
[[nodiscard]] Vector6d local_coordinates(const Eigen::Isometry3d& t);

/// Transforms a small motion from frame b to frame a.
[[nodiscard]] Matrix6d adjoint(const Eigen::Isometry3d& a_from_b);

}  // namespace cairn
