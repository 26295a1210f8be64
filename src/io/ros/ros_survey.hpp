// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Content of a ROS recording: topics of depth, color and motion, and the cameras.
#pragma once
#include <optional>

#include "cairn/io/source.hpp"
#include "io/ros/ros_messages.hpp"
#include "io/ros/ros_recording.hpp"

namespace cairn {

/// Topic, and the time source of its messages.
struct RosStream {
  std::size_t topic = 0;
  std::optional<double> after_arrival;  // seconds; empty: header times are used
};

struct RosPlan {
  Rig rig;
  RosStream depth;
  std::optional<RosStream> color, gyro, accelerometer;
  double unit = 1e-3;          // meters per unit of integer depth
  double interval = 1.0 / 30;  // seconds between depth images
  Eigen::Matrix3d depth_from_accelerometer = Eigen::Matrix3d::Identity();
};

/// Reads the first messages of a recording, as many as needed, and rewinds it. Throws std::runtime_error with the
/// missing data and a remedy.
[[nodiscard]] RosPlan plan_of(RosRecording& recording, const SourceOptions& options);

/// Time of a message in seconds; `header`: the message's header.
[[nodiscard]] double time_of(const RosStream& stream, const RosMessage& message, const RosHeader& header);

}  // namespace cairn
