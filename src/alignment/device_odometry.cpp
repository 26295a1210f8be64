// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "alignment/device_odometry.hpp"

#include <algorithm>

#include "base/median.hpp"

namespace cairn {
namespace {

constexpr double kMinDrift = 0.01, kTypicalDrift = 0.03;                // of visual-inertial odometry
constexpr int kMaxContradictions = 30;                                  // consecutive frames
constexpr double kMaxRotationDrift = 0.15, kMaxTranslationDrift = 0.3;  // larger: contradicts tracking
// A window ends with this motion; shorter motions measure noise.
constexpr double kWindowRotation = 0.15, kWindowTranslation = 0.1;  // rad, m
constexpr double kWindowErrors = 10;  // times the error of the alignment: min. motion of a window
constexpr double kMaxWindow = 3;      // seconds; a longer window without this motion restarts
constexpr std::size_t kMinWindows = 3, kMaxWindows = 16;
constexpr double kCorrelatedPoints = 100;  // neighboring points that count as one
constexpr double kChiSquared999 = 22.46;   // 99.9 % of the chi-squared distribution with 6 degrees of freedom

double angle_of(const Eigen::Isometry3d& motion) { return Eigen::AngleAxisd(motion.linear()).angle(); }

}  // namespace

void DeviceOdometry::add(double timestamp, const std::optional<Eigen::Isometry3d>& device, const AlignedPose& aligned) {
  contradictions = aligned.contradicts_device ? contradictions + 1 : 0;
  if (contradictions > kMaxContradictions) windows.assign(kMaxWindows, {1, 1});
  if (!device) return window.reset();
  if (!window || timestamp - window->timestamp > kMaxWindow) {
    window = {timestamp, *device, aligned.pose};
    return;
  }
  const Eigen::Isometry3d by_device = window->device.inverse() * *device;
  const Eigen::Isometry3d by_alignment = window->tracked.inverse() * aligned.pose;
  const double angle = std::max(angle_of(by_device), angle_of(by_alignment));
  const double length = std::max(by_device.translation().norm(), by_alignment.translation().norm());
  const PoseSigma& noise = aligned.common_error;
  const double min_angle = std::max(kWindowRotation, kWindowErrors * noise.rotation);
  const double min_length = std::max(kWindowTranslation, kWindowErrors * noise.translation);
  if (angle < min_angle && length < min_length) return;
  const Vector6d error = local_coordinates(by_device.inverse() * by_alignment);
  // The error of both ends of the window is not the device's.
  const auto excess = [](double squared, double sigma) {
    return std::sqrt(std::max(0.0, squared - 2 * sigma * sigma));
  };
  windows.push_back({excess(error.head<3>().squaredNorm(), noise.rotation) / std::max(angle, min_angle),
                     excess(error.tail<3>().squaredNorm(), noise.translation) / std::max(length, min_length)});
  if (windows.size() > kMaxWindows) windows.erase(windows.begin());
  window = {timestamp, *device, aligned.pose};
}

bool DeviceOdometry::is_known() const { return windows.size() >= kMinWindows; }

std::optional<DeviceDrift> DeviceOdometry::drift() const {
  if (!is_known()) return DeviceDrift{kTypicalDrift, kTypicalDrift};
  std::vector<double> rotations, translations;
  for (const DeviceDrift& error : windows) {
    rotations.push_back(error.rotation);
    translations.push_back(error.translation);
  }
  const DeviceDrift drift{std::max(kMinDrift, median(rotations)), std::max(kMinDrift, median(translations))};
  if (drift.rotation > kMaxRotationDrift || drift.translation > kMaxTranslationDrift) return std::nullopt;
  return drift;
}

bool fuse_device_pose(const Eigen::Isometry3d& predicted, const Matrix6d& covariance, const PoseSigma& common_error,
                      Alignment& alignment) {
  Matrix6d of_alignment = kCorrelatedPoints * (alignment.information + 1e-6 * Matrix6d::Identity()).inverse();
  of_alignment += covariance_of(common_error);
  const Vector6d off = local_coordinates(alignment.submap_from_camera.inverse() * predicted);
  const auto sum = Matrix6d(of_alignment + covariance).ldlt();
  if (off.dot(sum.solve(off)) > kChiSquared999) return false;
  alignment.submap_from_camera = alignment.submap_from_camera * retract(of_alignment * sum.solve(off));
  alignment.information = kCorrelatedPoints * (of_alignment.inverse() + covariance.inverse());
  alignment.fit.unobserved = 0;
  return true;
}

}  // namespace cairn
