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

/// The images of a frame as the files that hold them.
struct EncodedFrame {
  double timestamp = 0, colour_delay = 0;  ///< seconds
  std::vector<std::uint8_t> depth;         ///< PNG, 16 bit, 5000 a metre
  std::vector<std::uint8_t> colour;        ///< JPEG, or PNG; empty: none
  std::string colour_extension;
  std::optional<Eigen::Vector3d> acceleration;
};

/// Any thread. Depth beyond 13.1 m does not fit and becomes "no measurement".
[[nodiscard]] EncodedFrame encode(const Frame& frame, const Rig& rig, bool colour_as_png = false);

/// Writes a recording in TUM's layout as it is taken: images, camera.yaml and the lists rgb.txt, depth.txt and
/// accelerometer.txt. An image is whole before a list names it, so what is there can be read whenever the program ends.
class Recorder {
 public:
  /// Throws std::runtime_error when the folder cannot be made or holds something.
  Recorder(std::filesystem::path folder, const Rig& rig);
  /// Throws std::runtime_error when the disk is full; the recording is as it was before then.
  void add(const EncodedFrame& frame);
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }  ///< written

 private:
  void append(const char* list, const std::string& line);

  std::filesystem::path folder_;
  std::uint64_t bytes_ = 0;
};

}  // namespace cairn
