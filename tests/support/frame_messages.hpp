// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Messages of a network camera.
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace cairn {

inline std::string little_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 255);
  return bytes;
}

/// Header and data of a message; over TCP its size precedes it.
inline std::string message_of(const std::string& header, const std::string& data = {}) {
  return little_endian(static_cast<std::uint32_t>(header.size())) + header + data;
}
inline std::string message_of(const nlohmann::json& header, const std::string& data = {}) {
  return message_of(header.dump(), data);
}

/// Camera of 16x16 pixels with an inertial sensor.
inline nlohmann::json tiny_camera() {
  return {{"width", 16},
          {"height", 16},
          {"fx", 16},
          {"fy", 16},
          {"cx", 7.5},
          {"cy", 7.5},
          {"imu", {{"rotation", {0, 0, 0, 1}}}}};
}
inline nlohmann::json small_hello() { return {{"cairn", 1}, {"camera", tiny_camera()}, {"poses", true}}; }

/// Header of a frame with raw depth of 16x16 pixels.
inline nlohmann::json small_frame(int number) {
  return {{"frame", number}, {"time", number / 30.0}, {"depth", {{"format", "uint16"}, {"bytes", 512}}}};
}
inline std::string small_depth() {
  std::string depth;
  for (int i = 0; i < 256; ++i) depth += {static_cast<char>(0xe8), '\3'};  // 1000
  return depth;
}

}  // namespace cairn
