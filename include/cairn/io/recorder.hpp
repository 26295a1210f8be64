// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Units per meter of depth images in the TUM benchmark.
inline constexpr double kTumDepthScale = 5000;

/// Units per meter of a depth image that reproduces the frame's depth exactly, if it came from images in such units
/// (millimeters are tried first); else kTumDepthScale.
[[nodiscard]] double exact_depth_scale(const Frame& frame);

/// Images of a frame, encoded as file contents.
struct EncodedFrame {
  double timestamp = 0, color_delay = 0;  ///< seconds
  std::vector<std::uint8_t> depth;        ///< PNG, 16 bit
  std::vector<std::uint8_t> color;        ///< JPEG, or PNG; empty: none
  std::string color_extension;
  std::vector<std::uint8_t> confidence;  ///< PNG, 8 bit; empty: none
  std::optional<Eigen::Vector3d> acceleration;
  std::vector<AngularRate> gyro;
  std::vector<Acceleration> accelerations;
};

/// Encodes a frame. Safe to call from any thread. Depth above 65535 units (13.1 m at TUM's scale) becomes "no
/// measurement".
[[nodiscard]] EncodedFrame encode(const Frame& frame, const Rig& rig, bool color_as_png = false,
                                  double depth_scale = kTumDepthScale);

/// Writes a recording in TUM's layout while it is captured: images, camera.yaml and the lists rgb.txt, depth.txt,
/// accelerometer.txt and gyroscope.txt. An image is complete before a list names it, so the recording is readable
/// whenever the program ends.
class Recorder {
 public:
  /// `depth_scale`: units per meter of the encoded frames. Throws std::runtime_error if the folder cannot be created or
  /// is not empty.
  Recorder(std::filesystem::path folder, const Rig& rig, double depth_scale = kTumDepthScale);
  /// Adds a frame. Throws std::runtime_error if the disk is full; the recording then stays as before the call.
  void add(const EncodedFrame& frame);
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }  ///< bytes written so far

 private:
  void append(const char* list, const std::string& line);

  std::filesystem::path folder_;
  std::uint64_t bytes_ = 0;
};

}  // namespace cairn
