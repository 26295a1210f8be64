// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "cairn/mapping/frame.hpp"

namespace cairn {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

/// Noise of an inertial sensor, equal on all axes. Defaults: three times the densities of a phone's sensor (Bosch
/// BMI270), for vibration and scale errors.
struct InertialNoise {
  double gyro = 3.7e-4;             // rad/s/sqrt(Hz)
  double acceleration = 5e-3;       // m/s^2/sqrt(Hz)
  double gyro_walk = 2e-4;          // rad/s^2/sqrt(Hz)
  double acceleration_walk = 1e-3;  // m/s^3/sqrt(Hz)
};

struct InertialBias {
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();          // rad/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // m/s^2
};

/// Mount of the sensor on the camera.
struct InertialMount {
  Eigen::Quaterniond imu_from_camera = Eigen::Quaterniond::Identity();  // correction of the camera's nominal axes
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();  // of the camera from the sensor, m, in the sensor's axes
};

inline constexpr double kStandardGravity = 9.81;  // m/s^2

/// Pre-integrated motion of an inertial sensor between times i and j (Forster et al. 2017, eq. 33 to 44), in its frame
/// at i, without gravity. Rates and accelerations have the same axes.
struct Preintegration {
  InertialBias bias;                                             // subtracted from the samples
  double seconds = 0;                                            // from i to j
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // from the frame at j to the frame at i
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();            // m/s
  Eigen::Vector3d position = Eigen::Vector3d::Zero();            // m
  /// Covariance of (rotation in the frame at j, velocity, position), eq. 63; without the random walk of the biases.
  Matrix9d covariance = Matrix9d::Zero();
  // Derivatives with respect to the biases, eq. 44. The rotation's is in the frame at j.
  Eigen::Matrix3d rotation_by_gyro = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_by_gyro = Eigen::Matrix3d::Zero(), velocity_by_acceleration = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d position_by_gyro = Eigen::Matrix3d::Zero(), position_by_acceleration = Eigen::Matrix3d::Zero();

  /// First-order update for a changed bias, eq. 44; without a change of the derivatives and of `bias`.
  [[nodiscard]] Preintegration corrected(const InertialBias& changed) const;
};

/// Integrates the samples from `since` to `until` (seconds). Rates and accelerations are linear between samples; the
/// accelerometer may have its own times. The first and last sample extend by at most 0.1 s. Empty if samples are
/// missing for more than 0.1 s, or `until` is not after `since`.
[[nodiscard]] std::optional<Preintegration> preintegrate(const std::vector<AngularRate>& rates,
                                                         const std::vector<Acceleration>& accelerations, double since,
                                                         double until, const InertialBias& bias,
                                                         const InertialNoise& noise);

/// Rotation by a vector, and its inverse for rotations below 180 degrees; radians.
[[nodiscard]] Eigen::Quaterniond rotation_by(const Eigen::Vector3d& angle);
[[nodiscard]] Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& rotation);
/// Matrix of the cross product.
[[nodiscard]] Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);
/// Right Jacobian of SO(3) and its inverse (Forster et al. 2017, eq. 8 and 9).
[[nodiscard]] Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& angle);
[[nodiscard]] Eigen::Matrix3d inverse_right_jacobian(const Eigen::Vector3d& angle);

}  // namespace cairn
