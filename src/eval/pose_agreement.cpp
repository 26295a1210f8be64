// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/pose_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/median.hpp"

namespace cairn {
namespace {

// Combined drift of visual-inertial odometry and of tracking.
constexpr double kDriftTranslation = 0.05, kDriftPerMeter = 0.03;  // meters, and share of the path length
constexpr double kDriftRotation = 2 * std::numbers::pi / 180,
                 kDriftPerRadian = 0.02;  // radians, and share of the rotation
constexpr double kMaxScaleError = 0.03;   // of all lengths
constexpr double kWindows[] = {1, 5};     // seconds
constexpr double kMinBaseline = 0.3;  // minimum distance in meters between the ends of a window, for a ratio of lengths
constexpr std::size_t kMinPoses = 3;  // poses

/// Both poses at a time, with the device's path length and rotation so far.
struct Both {
  double timestamp;
  Eigen::Isometry3d tracked, device;
  double path_length = 0, rotation = 0;  // meters, radians
};

double angle_of(const Eigen::Isometry3d& motion) { return Eigen::AngleAxisd(motion.linear()).angle(); }

std::vector<Both> matched(const Trajectory& tracked, const Trajectory& device) {
  std::vector<Both> all;
  for (const StampedPose& pose : tracked)
    if (const auto other = pose_at(device, pose.timestamp)) {
      Both both{.timestamp = pose.timestamp, .tracked = pose.world_from_camera, .device = *other};
      if (!all.empty()) {
        const Eigen::Isometry3d step = all.back().device.inverse() * both.device;
        both.path_length = all.back().path_length + step.translation().norm(),
        both.rotation = all.back().rotation + angle_of(step);
      }
      all.push_back(both);
    }
  return all;
}

/// Difference of two relative motions, with the limits due to drift.
struct Difference {
  double shift, turn, allowed_shift, allowed_turn;
  [[nodiscard]] bool is_beyond() const { return shift > allowed_shift || turn > allowed_turn; }
};

Difference difference(const Both& a, const Both& b, double drift) {
  const Eigen::Isometry3d tracked = a.tracked.inverse() * b.tracked, device = a.device.inverse() * b.device;
  return {.shift = (tracked.translation() - device.translation()).norm(),
          .turn = angle_of(tracked.inverse() * device),
          .allowed_shift = drift * (kDriftTranslation + kDriftPerMeter * (b.path_length - a.path_length)),
          .allowed_turn = drift * (kDriftRotation + kDriftPerRadian * (b.rotation - a.rotation))};
}

}  // namespace

PoseAgreement compare_poses(const Trajectory& tracked, const Trajectory& device, double drift) {
  PoseAgreement agreement{.allowed_scale = drift * kMaxScaleError};
  const std::vector<Both> all = matched(tracked, device);
  if (all.size() < kMinPoses) return agreement;
  std::vector<double> ratios;
  int beyond = 0;
  for (const double seconds : kWindows)
    for (std::size_t begin = 0, end = 0; begin < all.size();) {
      while (end < all.size() && all[end].timestamp < all[begin].timestamp + seconds) ++end;
      if (end == all.size()) break;
      ++agreement.windows;
      beyond += difference(all[begin], all[end], drift).is_beyond();
      const double distance = (all[begin].device.inverse() * all[end].device).translation().norm();
      if (distance > kMinBaseline)
        ratios.push_back((all[begin].tracked.inverse() * all[end].tracked).translation().norm() / distance);
      // Windows overlap by half.
      const double next = all[begin].timestamp + seconds / 2;
      while (begin < all.size() && all[begin].timestamp < next) ++begin;
    }
  if (agreement.windows > 0) agreement.beyond = static_cast<double>(beyond) / agreement.windows;
  const Difference total = difference(all.front(), all.back(), drift);
  agreement.shift = total.shift, agreement.allowed_shift = total.allowed_shift;
  agreement.turn = total.turn, agreement.allowed_turn = total.allowed_turn;
  agreement.scaled_windows = static_cast<int>(ratios.size());
  if (!ratios.empty()) {
    agreement.scale = median(ratios);
    for (double& ratio : ratios) ratio = std::abs(ratio - agreement.scale);
    agreement.scale_spread = median(std::move(ratios));
  }
  return agreement;
}

}  // namespace cairn
