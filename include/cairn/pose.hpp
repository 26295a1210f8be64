// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>

namespace cairn {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;  ///< (rotation, translation): radians, metres

/// Rotation about the vector's first half by its length, and translation by the second half.
[[nodiscard]] Eigen::Isometry3d retract(const Vector6d& x);

/// The other way round, for rotations of less than half a turn.
[[nodiscard]] Vector6d local_coordinates(const Eigen::Isometry3d& t);

/// How a small motion given in frame b reads in frame a.
[[nodiscard]] Matrix6d adjoint(const Eigen::Isometry3d& a_from_b);

}  // namespace cairn
