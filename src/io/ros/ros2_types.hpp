// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Message types of ROS 2 as types of Cyclone DDS.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

/// Fields of a message type, for a topic descriptor of Cyclone DDS.
struct Ros2Layout {
  std::vector<std::uint32_t> instructions;
  std::uint32_t count = 0;  // of instructions with their operands
  std::uint32_t size = 0;   // bytes in memory, as in C; a string is a pointer, a list a dds_sequence
};
/// Layout of a type in ROS 1 notation, "sensor_msgs/Image"; nullopt for unsupported types.
[[nodiscard]] std::optional<Ros2Layout> ros2_layout(std::string_view type);

/// Converts "sensor_msgs/Image" to "sensor_msgs::msg::dds_::Image_", and back; empty for another name.
[[nodiscard]] std::string to_dds_type(std::string_view type);
[[nodiscard]] std::string from_dds_type(std::string_view dds_type);

}  // namespace cairn
