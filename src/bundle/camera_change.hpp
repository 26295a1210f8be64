// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <Eigen/LU>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// Deviation of a camera from its nominal calibration, independent of resolution: the actual camera images the ray (m,
/// 1) where the nominal camera images the ray (stretch m (1 + bend |m|^2) + shift, 1).
struct CameraChange {
  static constexpr int kUnknowns = 5;  // stretch, shift, bend
  using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
  Unknowns value = Unknowns::Zero();

  [[nodiscard]] Eigen::Array2d stretch() const { return 1 + value.head<2>().array(); }
  [[nodiscard]] Eigen::Vector2d shift() const { return value.segment<2>(2); }
  [[nodiscard]] double bend() const { return value[4]; }

  [[nodiscard]] Eigen::Vector2d to_nominal(const Eigen::Vector2d& m) const {
    return (stretch() * m.array() * (1 + bend() * m.squaredNorm())).matrix() + shift();
  }
  /// Inverse of `to_nominal`, by iteration.
  [[nodiscard]] Eigen::Vector2d from_nominal(const Eigen::Vector2d& place) const {
    const Eigen::Vector2d bent = ((place - shift()).array() / stretch()).matrix();
    Eigen::Vector2d m = bent;
    constexpr int kIterations = 20;
    for (int i = 0; i < kIterations; ++i) m = bent / (1 + bend() * m.squaredNorm());
    return m;
  }
  [[nodiscard]] Eigen::Matrix2d to_nominal_by_ray(const Eigen::Vector2d& m) const {
    const Eigen::Matrix2d bent =
        (1 + bend() * m.squaredNorm()) * Eigen::Matrix2d::Identity() + 2 * bend() * m * m.transpose();
    return stretch().matrix().asDiagonal() * bent;
  }
  [[nodiscard]] Eigen::Matrix<double, 2, kUnknowns> to_nominal_by_unknowns(const Eigen::Vector2d& m) const {
    const Eigen::Vector2d bent = (1 + bend() * m.squaredNorm()) * m;
    Eigen::Matrix<double, 2, kUnknowns> by;
    by.leftCols<2>() = bent.asDiagonal();
    by.middleCols<2>(2).setIdentity();
    by.col(4) = stretch() * m.array() * m.squaredNorm();
    return by;
  }
  /// Derivative of `from_nominal` by the unknowns.
  [[nodiscard]] Eigen::Matrix<double, 2, kUnknowns> from_nominal_by_unknowns(const Eigen::Vector2d& m) const {
    return -to_nominal_by_ray(m).inverse() * to_nominal_by_unknowns(m);
  }
  /// Applies the deviation to the nominal camera: the bend is added to the first radial distortion coefficient, to
  /// first order if the lens already has one.
  [[nodiscard]] Camera applied_to(Camera camera) const {
    camera.cx += camera.fx * shift().x(), camera.cy += camera.fy * shift().y();
    camera.fx *= stretch().x(), camera.fy *= stretch().y();
    camera.distortion[0] += bend();
    return camera;
  }
};

}  // namespace cairn
