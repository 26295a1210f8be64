// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <span>

namespace cairn {

/// Converts a row-major 4x4 or 3x4 matrix to a pose, with the rotation orthonormalized; empty if the matrix is not
/// finite, its translation exceeds 1e6 m, or its linear part is no rotation within 2 %.
[[nodiscard]] inline std::optional<Eigen::Isometry3d> pose_of_rows(std::span<const double> numbers) {
  constexpr double kMaxRotationError = 0.02, kMaxTranslation = 1e6;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c) pose.matrix()(r, c) = numbers[static_cast<std::size_t>(4 * r + c)];
  if (!pose.matrix().allFinite() || pose.translation().cwiseAbs().maxCoeff() > kMaxTranslation) return std::nullopt;
  const Eigen::Matrix3d rotation = pose.linear();
  const double error = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= kMaxRotationError) || rotation.determinant() < 0) return std::nullopt;
  if (!rotation.isIdentity(0)) pose.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  return pose;
}

/// Returns the transform from Cairn's camera frame to OpenGL's and ARKit's (x right, y up, z back): half a turn about
/// x.
[[nodiscard]] inline Eigen::Isometry3d opengl_from_camera() {
  Eigen::Isometry3d rotation = Eigen::Isometry3d::Identity();
  rotation.linear().diagonal() = Eigen::Vector3d(1, -1, -1);
  return rotation;
}

}  // namespace cairn
