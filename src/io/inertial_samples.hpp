// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cmath>
#include <deque>

#include "cairn/mapping/frame.hpp"

namespace cairn {

inline constexpr double kAccelerationWindow = 0.25;  // seconds around a frame, to average out hand shake

/// Samples of a gyroscope and an accelerometer until their frame is read, in time order; bounded.
class InertialSamples {
 public:
  void add_rate(const AngularRate& rate);
  void add_acceleration(const Acceleration& acceleration);
  /// Moves the samples up to the frame's time into the frame, without samples up to `since`, and sets its acceleration
  /// to the mean around its time.
  void attach_to(Frame& frame, double since = -INFINITY);

 private:
  std::deque<AngularRate> rates_;
  std::deque<Acceleration> accelerations_;
  double attached_until_ = -INFINITY;  // seconds, of accelerations
};

}  // namespace cairn
