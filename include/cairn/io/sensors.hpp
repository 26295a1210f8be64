// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <string>
#include <vector>

namespace cairn {

/// A connected depth sensor.
struct SensorInfo {
  std::string input;  ///< name for open_source: "realsense:SERIAL"
  std::string model;  ///< as reported by the sensor
};

/// Sensors of a library.
struct SensorLibrary {
  std::string input;                   ///< name of its first sensor for open_source: "realsense:"
  std::vector<SensorInfo> sensors;     ///< connected sensors
  std::optional<std::string> missing;  ///< reason and remedy, if the library is not usable
};

/// Connected sensors of all libraries: OpenNI2, librealsense2, libk4a; and depth topics of a running ROS 2 graph.
[[nodiscard]] std::vector<SensorLibrary> list_sensors();

}  // namespace cairn
