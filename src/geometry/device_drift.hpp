// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/mapping/pose.hpp"

namespace cairn {

/// Drift of a device's own tracking: standard deviation of a motion, as a share of the motion.
struct DeviceDrift {
  double rotation = 0;     // rad per rad
  double translation = 0;  // m per m
  friend bool operator==(const DeviceDrift&, const DeviceDrift&) = default;
};

/// Standard deviations of a pose.
struct PoseSigma {
  double rotation = 0;     // rad
  double translation = 0;  // m
};

/// Diagonal covariance of a pose, rad^2 and m^2.
[[nodiscard]] inline Matrix6d covariance_of(const PoseSigma& sigma) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(sigma.rotation * sigma.rotation),
      Eigen::Vector3d::Constant(sigma.translation * sigma.translation);
  return covariance;
}

/// Covariance of a relative pose by the device's own tracking, in the frame of its end; rad^2 and m^2.
[[nodiscard]] inline Matrix6d device_covariance(const DeviceDrift& drift, const Eigen::Isometry3d& motion) {
  constexpr double kRotationNoise = 1e-4, kTranslationNoise = 1e-4;  // rad, m: of a single pose
  return covariance_of({.rotation = kRotationNoise + drift.rotation * Eigen::AngleAxisd(motion.linear()).angle(),
                        .translation = kTranslationNoise + drift.translation * motion.translation().norm()});
}

}  // namespace cairn
