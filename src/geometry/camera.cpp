// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "cairn/mapping/rig.hpp"

namespace cairn {
namespace {

constexpr int kMinSide = 16, kMaxSide = 4096;  // pixels: three levels of the pyramid, 128 MiB of fusion image
constexpr double kMinFocalRatio = 1.0 / 20,
                 kMaxFocalRatio = 20;    // focal length / larger side: fields of view of 169 and 2.9 degrees
constexpr double kMaxBaseline = 10;      // m between the depth and the color camera
constexpr double kMaxReadout = 0.2;      // s
constexpr double kMaxDistortion = 1000;  // of a coefficient: twenty times the values of fisheye-like calibrations

void within(const char* name, double value, double min, double max) {
  if (!(value >= min && value <= max))  // also rejects NaN
    throw std::runtime_error(
        fmt::format("the camera's {} is {}, allowed: {} to {}; check the intrinsics", name, value, min, max));
}

}  // namespace

Eigen::Vector2d Camera::distort(const Eigen::Vector2d& n) const {
  const auto& k = distortion;
  if (lens == Lens::fisheye) {
    const double r = n.norm(), angle = std::atan(r), a2 = angle * angle;
    const double bent = angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
    return r > 0 ? Eigen::Vector2d(n * (bent / r)) : n;
  }
  const double r2 = n.squaredNorm(), xy = n.x() * n.y();
  const double radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return n * radial + Eigen::Vector2d(2 * k[2] * xy + k[3] * (r2 + 2 * n.x() * n.x()),
                                      k[2] * (r2 + 2 * n.y() * n.y()) + 2 * k[3] * xy);
}

Eigen::Vector2d Camera::undistorted_ray(double u, double v) const {
  constexpr int kIterations = 20;
  constexpr double kStep = 1e-6, kTolerance = 1e-12;
  Eigen::Vector2d measured((u - cx) / fx, (v - cy) / fy);
  if (!distorted()) return measured;
  Eigen::Vector2d ray = measured;
  for (int i = 0; i < kIterations; ++i) {  // Newton's method
    const Eigen::Vector2d off = distort(ray) - measured;
    Eigen::Matrix2d slope;
    slope << (distort(ray + Eigen::Vector2d(kStep, 0)) - distort(ray - Eigen::Vector2d(kStep, 0))) / (2 * kStep),
        (distort(ray + Eigen::Vector2d(0, kStep)) - distort(ray - Eigen::Vector2d(0, kStep))) / (2 * kStep);
    const Eigen::Vector2d step = slope.inverse() * off;
    if (!step.allFinite()) break;
    ray -= step;
    if (step.norm() < kTolerance) break;
  }
  return ray;
}

double Camera::widest_ray() const {
  constexpr double kStep = 0.01;  // tangent of the angle to the axis
  constexpr int kSteps = 2000;
  const double corner = std::hypot(std::max(cx, width - cx) / fx, std::max(cy, height - cy) / fy);
  double before = 0;
  for (int i = 1; i < kSteps; ++i) {
    const double r = kStep * i;
    const double bent = distort({r, 0}).x();
    if (bent <= before) return r - kStep;  // the polynomial folds back beyond
    if (bent > 1.2 * corner) return r;
    before = bent;
  }
  return kStep * kSteps;
}

void check(const Camera& c) {
  within("width", c.width, kMinSide, kMaxSide);
  within("height", c.height, kMinSide, kMaxSide);
  const double side = std::max(c.width, c.height);
  within("fx", c.fx, kMinFocalRatio * side, kMaxFocalRatio * side);
  within("fy", c.fy, kMinFocalRatio * side, kMaxFocalRatio * side);
  within("cx", c.cx, -c.width, 2.0 * c.width);
  within("cy", c.cy, -c.height, 2.0 * c.height);
  if (c.lens != Lens::brown_conrady && c.lens != Lens::fisheye)
    throw std::runtime_error("the camera's lens is unknown; expected brown_conrady or fisheye");
  within("readout (seconds)", c.readout, 0, kMaxReadout);
  for (const double d : c.distortion) within("distortion", d, -kMaxDistortion, kMaxDistortion);
}

void check(const Rig& rig) {
  check(rig.depth);
  check(rig.sensor);
  check(rig.depth_correction);
  if (rig.camera_from_imu && !(std::abs(rig.camera_from_imu->norm() - 1) <= 1e-3))
    throw std::runtime_error("camera_from_imu is not a rotation; check the extrinsics");
  if (!rig.color) return;
  try {
    check(rig.color->camera);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(std::string("color: ") + error.what());
  }
  const Eigen::Isometry3d& pose = rig.color->color_from_depth;
  for (const double meters : pose.translation())
    within("color_from_depth (meters)", meters, -kMaxBaseline, kMaxBaseline);
  const Eigen::Matrix3d rotation = pose.linear();
  if (!(rotation * rotation.transpose()).isIdentity(1e-3) || rotation.determinant() < 0)
    throw std::runtime_error("the rotation of color_from_depth is invalid; check the extrinsics");
}

}  // namespace cairn
