// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "cairn/frame.hpp"

namespace cairn {

/// How the camera turned, by its gyroscope: the rates between two frames, integrated on SO(3) without their bias
/// (Forster et al. 2017, eq. 35). The bias, and where the rig does not tell it the sensor's place in the camera, come
/// from turns that alignment has found.
class Gyroscope {
 public:
  explicit Gyroscope(const std::optional<Eigen::Quaterniond>& camera_from_imu) : camera_from_imu_(camera_from_imu) {}

  /// Rates of a frame, after those that are known.
  void add(const std::vector<AngularRate>& samples);
  /// Forgets those that nothing after `time` asks for.
  void forget_before(double time);
  /// From the camera at `until` to the camera at `since` (seconds); nothing where samples are missing, or while the
  /// sensor's place is not known.
  [[nodiscard]] std::optional<Eigen::Quaterniond> turn(double since, double until) const;
  /// The camera's rate at about `time`, rad/s in its frame; nothing as above.
  [[nodiscard]] std::optional<Eigen::Vector3d> rate(double time) const;
  /// What alignment found, from the camera at `until` to that at `since`.
  void learn(double since, double until, const Eigen::Quaterniond& turned);

  /// What it knows, to go on with later.
  struct Memory {
    std::vector<AngularRate> samples;  // in the order of time
    // Sums over what was learned, old ones fading: mean rates in the sensor's axes and in the camera's.
    double count = 0;
    Eigen::Vector3d imu = Eigen::Vector3d::Zero(), camera = Eigen::Vector3d::Zero();
    Eigen::Matrix3d camera_imu = Eigen::Matrix3d::Zero();
  };
  [[nodiscard]] const Memory& memory() const { return memory_; }
  void restore(const Memory& memory) { memory_ = memory; }

  [[nodiscard]] std::optional<Eigen::Quaterniond> camera_from_imu() const;
  [[nodiscard]] Eigen::Vector3d bias() const;  ///< rad/s, in the sensor's axes

 private:
  /// Of the sensor's rates, without bias, in its axes; nothing where samples are missing.
  [[nodiscard]] std::optional<Eigen::Quaterniond> integrated(double since, double until,
                                                             const Eigen::Vector3d& bias) const;

  std::optional<Eigen::Quaterniond> camera_from_imu_;
  Memory memory_;
};

}  // namespace cairn
