// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Camera rotation from a gyroscope: rates between two frames, bias corrected and integrated on SO(3) (Forster et al.
/// 2017, eq. 35). The bias, and the sensor's orientation if not given by the rig, are estimated from rotations of the
/// alignment.
class Gyroscope {
 public:
  explicit Gyroscope(const std::optional<Eigen::Quaterniond>& camera_from_imu) : camera_from_imu_(camera_from_imu) {}

  /// Adds the rates of a frame, after the earlier ones.
  void add(const std::vector<AngularRate>& samples);
  /// Drops samples not needed for times after `time`.
  void forget_before(double time);
  /// Rotation from the camera at `until` to the camera at `since` (seconds). Empty if samples are missing, the sensor's
  /// orientation is unknown, or the last learned rotations contradict the sensor.
  [[nodiscard]] std::optional<Eigen::Quaterniond> rotation(double since, double until) const;
  /// Angular rate of the camera near `time`, rad/s in its frame; empty as above.
  [[nodiscard]] std::optional<Eigen::Vector3d> rate(double time) const;
  /// Adds a rotation of the alignment, from the camera at `until` to the camera at `since`.
  void learn(double since, double until, const Eigen::Quaterniond& rotation);

  /// State for resuming.
  struct State {
    std::vector<AngularRate> samples;  // in order of time
    // Decaying sums over learned rotations: mean rates in the sensor's axes and in the camera's.
    double count = 0;
    Eigen::Vector3d imu = Eigen::Vector3d::Zero(), camera = Eigen::Vector3d::Zero();
    Eigen::Matrix3d camera_imu = Eigen::Matrix3d::Zero();
    // Decaying sums over the last learned rotations: their number, squared errors of the prediction, and squares;
    // rad^2.
    double recent = 0, squared_errors = 0, squares = 0;
  };
  [[nodiscard]] const State& save() const { return state_; }
  void restore(const State& state) { state_ = state; }

  [[nodiscard]] std::optional<Eigen::Quaterniond> camera_from_imu() const;
  [[nodiscard]] Eigen::Vector3d bias() const;  ///< rad/s, in the sensor's axes

 private:
  [[nodiscard]] bool is_contradicted() const;
  /// Rotation of the sensor, without bias correction of its own, in its axes. Empty if samples are missing.
  [[nodiscard]] std::optional<Eigen::Quaterniond> integrated(double since, double until,
                                                             const Eigen::Vector3d& bias) const;

  std::optional<Eigen::Quaterniond> camera_from_imu_;
  State state_;
};

}  // namespace cairn
