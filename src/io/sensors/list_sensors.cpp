// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <stdexcept>

#include "cairn/io/sensors.hpp"
#include "io/ros/ros_recording.hpp"
#include "io/sensors/k4a.hpp"
#include "io/sensors/openni.hpp"
#include "io/sensors/realsense.hpp"

namespace cairn {
namespace {

SensorLibrary list(std::string input, std::vector<SensorInfo> (*sensors)()) {
  SensorLibrary library{.input = std::move(input)};
  try {
    library.sensors = sensors();
  } catch (const std::runtime_error& error) {
    library.missing = error.what();
  }
  return library;
}

std::vector<SensorInfo> list_ros2() {
  std::vector<SensorInfo> sensors;
  for (std::string& topic : ros2_depth_topics()) sensors.push_back({std::string(kRos2), "--topic " + std::move(topic)});
  return sensors;
}

}  // namespace

std::vector<SensorLibrary> list_sensors() {
  return {list("openni:", list_openni), list("realsense:", list_realsense), list("k4a:", list_k4a),
          list(std::string(kRos2), list_ros2)};
}

}  // namespace cairn
