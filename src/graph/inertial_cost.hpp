// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <ceres/sized_cost_function.h>

#include "cairn/mapping/pose.hpp"
#include "inertial/preintegration.hpp"

namespace cairn {

/// Cost of a pre-integrated motion between the nodes i and j of a pose graph, with analytic derivatives (Forster et al.
/// 2017, eq. 44, 45 and the appendix). Residual of 15, in units of its noise:
///   rotation      log((dR exp(dR/dbg dbg))^T R_i^T R_j)               in the sensor's frame at j
///   velocity      R_i^T (v_j - v_i - g t) - (dv + dv/db db)           in the sensor's frame at i
///   position      R_i^T (p_j - p_i - v_i t - g t^2 / 2) - (dp + dp/db db)
///   biases        b_j - b_i: random walk
/// Parameters: the camera poses world_from_i and world_from_j (NodePose), of the nodes i and j (velocity of the sensor
/// in the world, m/s; bias of the gyroscope, rad/s; bias of the accelerometer, m/s^2), and gravity (m/s^2, in the
/// world, downward). R, p: pose of the sensor, from the camera's pose and the mount.
class InertialCost : public ceres::SizedCostFunction<15, 7, 7, 9, 9, 3> {
 public:
  InertialCost(const Preintegration& motion, const InertialMount& mount, const InertialNoise& noise);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  struct Terms;
  [[nodiscard]] Terms terms_at(double const* const* parameters) const;
  void derive_poses(const Terms& terms, double const* const* parameters, double** jacobians) const;
  void derive_motions(const Terms& terms, double** jacobians) const;

  Preintegration motion_;
  Eigen::Matrix3d camera_from_imu_;
  Eigen::Vector3d camera_in_imu_;         // position of the sensor's origin to the camera, in the camera's axes, m
  Matrix9d root_;                         // of the information: root^T root
  double gyro_root_, acceleration_root_;  // of the biases' information
};

}  // namespace cairn
