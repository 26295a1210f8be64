// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a recording of ROS is about: which topics hold depth, colour and motion, and what the cameras are.
#pragma once
#include <optional>

#include "cairn/source.hpp"
#include "io/ros_messages.hpp"
#include "io/ros_recording.hpp"

namespace cairn {

/// A topic, and how its messages get their times.
struct RosStream {
  std::size_t topic = 0;
  std::optional<double> after_arrival;  // seconds; nothing: messages have the times of their headers
};

struct RosPlan {
  Rig rig;
  RosStream depth;
  std::optional<RosStream> colour, gyro, accelerometer;
  double unit = 1e-3;          // metres, of depth in whole numbers
  double interval = 1.0 / 30;  // seconds between depth images
  Eigen::Matrix3d depth_from_accelerometer = Eigen::Matrix3d::Identity();
};

/// Reads the begin of a recording, as far as it takes, and leaves it there again. Throws std::runtime_error with what
/// is missing and what to do.
[[nodiscard]] RosPlan plan_of(RosRecording& recording, const SourceOptions& options);

/// Seconds; `header` as in the message.
[[nodiscard]] double time_of(const RosStream& stream, const RosMessage& message, const RosHeader& header);

}  // namespace cairn
