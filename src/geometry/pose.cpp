// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/pose.hpp"

namespace cairn {

Eigen::Isometry3d retract(const Vector6d& x) {
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  const double angle = x.head<3>().norm();
  if (angle > 0) t.linear() = Eigen::AngleAxisd(angle, x.head<3>() / angle).toRotationMatrix();
  t.translation() = x.tail<3>();
  return t;
}

Vector6d local_coordinates(const Eigen::Isometry3d& t) {
  const Eigen::AngleAxisd turn(t.linear());
  return (Vector6d() << turn.axis() * turn.angle(), t.translation()).finished();
}

Matrix6d adjoint(const Eigen::Isometry3d& a_from_b) {
  const Eigen::Matrix3d r = a_from_b.linear();
  const Eigen::Vector3d t = a_from_b.translation();
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = r;
  m.bottomRightCorner<3, 3>() = r;
  m.bottomLeftCorner<3, 3>() = cross * r;
  return m;
}

}  // namespace cairn
