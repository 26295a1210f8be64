// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/inertial_samples.hpp"

#include <algorithm>

#include "io/ros/time_order.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMaxSamples = 100000;  // of each sensor

}  // namespace

void InertialSamples::add_rate(const AngularRate& rate) {
  insert_by_time(rates_, rate, &AngularRate::timestamp);
  if (rates_.size() > kMaxSamples) rates_.pop_front();
}

void InertialSamples::add_acceleration(const Acceleration& acceleration) {
  insert_by_time(accelerations_, acceleration, &Acceleration::timestamp);
  if (accelerations_.size() > kMaxSamples) accelerations_.pop_front();
}

void InertialSamples::attach_to(Frame& frame, double since) {
  for (; !rates_.empty() && rates_.front().timestamp <= frame.timestamp; rates_.pop_front())
    if (rates_.front().timestamp > since) frame.gyro.push_back(rates_.front());
  for (const Acceleration& sample : accelerations_)
    if (sample.timestamp > std::max(since, attached_until_) && sample.timestamp <= frame.timestamp)
      frame.accelerations.push_back(sample);
  attached_until_ = frame.timestamp;
  while (!accelerations_.empty() && accelerations_.front().timestamp < frame.timestamp - kAccelerationWindow)
    accelerations_.pop_front();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const Acceleration& sample : accelerations_) {
    if (sample.timestamp > frame.timestamp + kAccelerationWindow) break;
    sum += sample.value;
    ++count;
  }
  if (count > 0) frame.acceleration = sum / count;
}

}  // namespace cairn
