// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "cairn/frame.hpp"

namespace cairn {

/// Units per metre of depth images in the TUM benchmark.
inline constexpr double kTumDepthScale = 5000;

/// Units per metre in which depth images give a frame's depth back exactly, as they do where it came from images of
/// such units (millimetres first); kTumDepthScale where there are none.
[[nodiscard]] double exact_depth_scale(const Frame& frame);

/// The images of a frame as the files that hold them.
struct EncodedFrame {
  double timestamp = 0, colour_delay = 0;  ///< seconds
  std::vector<std::uint8_t> depth;         ///< PNG, 16 bit
  std::vector<std::uint8_t> colour;        ///< JPEG, or PNG; empty: none
  std::string colour_extension;
  std::vector<std::uint8_t> confidence;  ///< PNG, 8 bit; empty: none
  std::optional<Eigen::Vector3d> acceleration;
  std::vector<AngularRate> gyro;
};

/// Any thread. Depth of more than 65535 units (13.1 m as in TUM's) does not fit and becomes "no measurement".
[[nodiscard]] EncodedFrame encode(const Frame& frame, const Rig& rig, bool colour_as_png = false,
                                  double depth_scale = kTumDepthScale);

/// Writes a recording in TUM's layout as it is taken: images, camera.yaml and the lists rgb.txt, depth.txt,
/// accelerometer.txt and gyroscope.txt. An image is whole before a list names it, so what is there can be read whenever
/// the program ends.
class Recorder {
 public:
  /// `depth_scale`: units per metre with which the frames are encoded. Throws std::runtime_error when the folder cannot
  /// be made or holds something.
  Recorder(std::filesystem::path folder, const Rig& rig, double depth_scale = kTumDepthScale);
  /// Throws std::runtime_error when the disk is full; the recording is as it was before then.
  void add(const EncodedFrame& frame);
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }  ///< written

 private:
  void append(const char* list, const std::string& line);

  std::filesystem::path folder_;
  std::uint64_t bytes_ = 0;
};

}  // namespace cairn
