// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cmath>
#include <deque>

#include "cairn/mapping/frame.hpp"

namespace cairn {

inline constexpr double kAccelerationWindow = 0.25;  // seconds around a frame, as for TUM recordings

/// Samples of a gyroscope and an accelerometer until their frame is read, in time order; bounded.
class InertialSamples {
 public:
  void add_rate(const AngularRate& rate);
  /// `acceleration`: m/s^2, in the depth camera's frame.
  void add_acceleration(double timestamp, const Eigen::Vector3d& acceleration);
  /// Moves the rates up to the frame's time into the frame, without rates up to `since`, and sets its acceleration to
  /// the mean around its time.
  void attach_to(Frame& frame, double since = -INFINITY);

 private:
  struct Acceleration {
    double timestamp;  // seconds
    Eigen::Vector3d value;
  };
  std::deque<AngularRate> rates_;
  std::deque<Acceleration> accelerations_;
};

}  // namespace cairn
