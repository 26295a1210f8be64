// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Messages of a program that sends frames over a network: docs/inputs.md, "Frames over a network".
//
// A message: size of the header in bytes as little-endian uint32, the header as JSON, then the parts of the header in
// the order depth, color, confidence. The first message is the hello, without parts.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "cairn/io/pose_convention.hpp"
#include "cairn/mapping/rig.hpp"
#include "io/sensors/sensor_source.hpp"

namespace cairn {

inline constexpr int kFrameProtocol = 1;                              // version
inline constexpr std::size_t kMaxFrameHeader = std::size_t{1} << 20;  // bytes of JSON
inline constexpr std::size_t kMaxMotionSamples = 5'000;               // of each inertial sensor, per frame
inline constexpr std::int64_t kMaxFrameNumber = 1'000'000'000;
inline constexpr double kDefaultDepthScale = 1000;  // units per meter of 16-bit depth

struct HelloMessage {
  Rig rig;
  double depth_scale = kDefaultDepthScale;  // units per meter of 16-bit depth; floats are meters
  std::optional<PoseConvention> poses;      // of the frames' poses; empty: frames without poses
  std::string token, name;                  // name: of the client, for messages
};

/// Reads a hello. Throws std::runtime_error with the field, its value and the remedy.
[[nodiscard]] HelloMessage read_hello(std::span<const std::uint8_t> message);

/// Size limit of a frame's message: header and uncompressed images, in bytes.
[[nodiscard]] std::size_t max_message_size(const HelloMessage& hello);

/// Last frame of a connection.
struct FrameOrder {
  std::int64_t number = -1;
  std::optional<double> timestamp;  // seconds; empty: without a time, or no frame yet
};

struct FrameMessage {
  bool is_end = false;        // {"end": true}: no further frames
  bool has_timestamp = true;  // false: images.timestamp is to be set to the time of arrival
  SensorImages images;
};

/// Reads a frame. Throws std::runtime_error with the field, its value and the remedy: malformed, sizes that differ from
/// the hello's cameras, values that are not finite, and numbers or times that do not increase after `before`.
[[nodiscard]] FrameMessage read_frame(std::span<const std::uint8_t> message, const HelloMessage& hello,
                                      const FrameOrder& before);

}  // namespace cairn
