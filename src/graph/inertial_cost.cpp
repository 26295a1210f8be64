// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/inertial_cost.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace cairn {
namespace {

template <int columns>
using Rows = Eigen::Matrix<double, 15, columns, columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
using Vector3d = Eigen::Vector3d;
using Matrix3d = Eigen::Matrix3d;

// Rows of the residual, and columns of a node's velocity and biases.
constexpr int kRotation = 0, kVelocity = 3, kPosition = 6, kBias = 9;
constexpr int kGyro = 3, kAcceleration = 6;

/// Derivative of the angle of a rotation on the right side of a unit quaternion (x, y, z, w): 2 vec(q^* dq).
Eigen::Matrix<double, 3, 4> angle_by_quaternion(const double* q) {
  const Vector3d v(q[0], q[1], q[2]);
  Eigen::Matrix<double, 3, 4> m;
  m.leftCols<3>() = 2 * (q[3] * Matrix3d::Identity() - cross_matrix(v));
  m.col(3) = -2 * v;
  return m;
}

}  // namespace

/// Values shared by the residual and its derivatives.
struct InertialCost::Terms {
  Matrix3d from_i, from_j;       // world_from_imu
  Vector3d velocity, position;   // R_i^T (...) of the residual
  Vector3d rotation_error;       // log(...)
  Vector3d rotation_correction;  // dR/dbg dbg
  Rows<1> residual;              // without units of noise
};

InertialCost::InertialCost(const Preintegration& motion, const InertialMount& mount, const InertialNoise& noise)
    : motion_(motion),
      camera_from_imu_(mount.imu_from_camera.conjugate().toRotationMatrix()),
      camera_in_imu_(camera_from_imu_ * mount.lever),
      root_(Eigen::LLT<Matrix9d>(motion.covariance.inverse()).matrixU()),
      gyro_root_(1 / (noise.gyro_walk * std::sqrt(motion.seconds))),
      acceleration_root_(1 / (noise.acceleration_walk * std::sqrt(motion.seconds))) {}

InertialCost::Terms InertialCost::terms_at(double const* const* parameters) const {
  const Eigen::Map<const Eigen::Quaterniond> qi(parameters[0]), qj(parameters[1]);
  const Eigen::Map<const Vector3d> ti(parameters[0] + 4), tj(parameters[1] + 4), vi(parameters[2]), vj(parameters[3]),
      gravity(parameters[4]);
  const Eigen::Map<const Vector6d> bi(parameters[2] + kGyro), bj(parameters[3] + kGyro);
  const Matrix3d ri = qi.toRotationMatrix(), rj = qj.toRotationMatrix();
  const double t = motion_.seconds;
  Terms s;
  s.from_i = ri * camera_from_imu_, s.from_j = rj * camera_from_imu_;
  const Vector3d pi = ti - ri * camera_in_imu_, pj = tj - rj * camera_in_imu_;
  const Vector3d gyro = bi.head<3>() - motion_.bias.gyro, acceleration = bi.tail<3>() - motion_.bias.acceleration;
  s.rotation_correction = motion_.rotation_by_gyro * gyro;
  const Eigen::Quaterniond expected = motion_.rotation * rotation_by(s.rotation_correction);
  s.rotation_error = rotation_vector(expected.conjugate() * Eigen::Quaterniond(s.from_i.transpose() * s.from_j));
  s.velocity = s.from_i.transpose() * (vj - vi - t * gravity);
  s.position = s.from_i.transpose() * (pj - pi - t * vi - 0.5 * t * t * gravity);
  s.residual << s.rotation_error,
      s.velocity -
          (motion_.velocity + motion_.velocity_by_gyro * gyro + motion_.velocity_by_acceleration * acceleration),
      s.position -
          (motion_.position + motion_.position_by_gyro * gyro + motion_.position_by_acceleration * acceleration),
      bj - bi;
  return s;
}

void InertialCost::derive_poses(const Terms& s, double const* const* parameters, double** jacobians) const {
  const Matrix3d imu_from_camera = camera_from_imu_.transpose(), to_i = s.from_i.transpose();
  const Matrix3d lever = cross_matrix(camera_in_imu_), inverse = inverse_right_jacobian(s.rotation_error);
  for (const int node : {0, 1}) {
    if (jacobians[node] == nullptr) continue;
    Eigen::Matrix<double, 9, 6> by_pose = Eigen::Matrix<double, 9, 6>::Zero();  // by (rotation, translation)
    if (node == 0) {
      by_pose.block<3, 3>(kRotation, 0) = -inverse * s.from_j.transpose() * s.from_i * imu_from_camera;
      by_pose.block<3, 3>(kVelocity, 0) = cross_matrix(s.velocity) * imu_from_camera;
      by_pose.block<3, 3>(kPosition, 0) = cross_matrix(s.position) * imu_from_camera - imu_from_camera * lever;
      by_pose.block<3, 3>(kPosition, 3) = -to_i;
    } else {
      by_pose.block<3, 3>(kRotation, 0) = inverse * imu_from_camera;
      by_pose.block<3, 3>(kPosition, 0) = to_i * s.from_j * imu_from_camera * lever;
      by_pose.block<3, 3>(kPosition, 3) = to_i;
    }
    const Eigen::Matrix<double, 9, 6> in_noise = root_ * by_pose;
    Eigen::Map<Rows<7>> out(jacobians[node]);
    out.bottomRows<6>().setZero();
    out.topLeftCorner<9, 4>() = in_noise.leftCols<3>() * angle_by_quaternion(parameters[node]);
    out.topRightCorner<9, 3>() = in_noise.rightCols<3>();
  }
}

void InertialCost::derive_motions(const Terms& s, double** jacobians) const {
  const double t = motion_.seconds;
  const Matrix3d to_i = s.from_i.transpose();
  const auto put = [&](int block, const Matrix9d& by_motion, double sign) {
    Eigen::Map<Rows<9>> out(jacobians[block]);
    out.topRows<9>() = root_ * by_motion;
    out.bottomRows<6>().setZero();
    out.block<3, 3>(kBias, kGyro).diagonal().setConstant(sign * gyro_root_);
    out.block<3, 3>(kBias + 3, kAcceleration).diagonal().setConstant(sign * acceleration_root_);
  };
  if (jacobians[2] != nullptr) {
    Matrix9d by_i = Matrix9d::Zero();
    by_i.block<3, 3>(kVelocity, 0) = -to_i;
    by_i.block<3, 3>(kPosition, 0) = -t * to_i;
    by_i.block<3, 3>(kRotation, kGyro) = -inverse_right_jacobian(s.rotation_error) *
                                         rotation_by(s.rotation_error).conjugate().toRotationMatrix() *
                                         right_jacobian(s.rotation_correction) * motion_.rotation_by_gyro;
    by_i.block<3, 3>(kVelocity, kGyro) = -motion_.velocity_by_gyro;
    by_i.block<3, 3>(kVelocity, kAcceleration) = -motion_.velocity_by_acceleration;
    by_i.block<3, 3>(kPosition, kGyro) = -motion_.position_by_gyro;
    by_i.block<3, 3>(kPosition, kAcceleration) = -motion_.position_by_acceleration;
    put(2, by_i, -1);
  }
  if (jacobians[3] != nullptr) {
    Matrix9d by_j = Matrix9d::Zero();
    by_j.block<3, 3>(kVelocity, 0) = to_i;
    put(3, by_j, 1);
  }
  if (jacobians[4] != nullptr) {
    Eigen::Map<Rows<3>> out(jacobians[4]);
    out.setZero();
    out.topRows<9>() =
        root_.middleCols<3>(kVelocity) * (-t * to_i) + root_.middleCols<3>(kPosition) * (-0.5 * t * t * to_i);
  }
}

bool InertialCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Terms s = terms_at(parameters);
  Eigen::Map<Rows<1>> out(residuals);
  out.head<9>() = root_ * s.residual.head<9>();
  out.segment<3>(kBias) = gyro_root_ * s.residual.segment<3>(kBias);
  out.tail<3>() = acceleration_root_ * s.residual.tail<3>();
  if (jacobians != nullptr) {
    derive_poses(s, parameters, jacobians);
    derive_motions(s, jacobians);
  }
  return true;
}

}  // namespace cairn
