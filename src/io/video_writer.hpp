// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

namespace cairn {

/// An MP4 file with one track of H.264, image by image.
class VideoWriter {
 public:
  /// Throws std::runtime_error when the file cannot be made, for an odd number of pixels a side, and where FFmpeg has
  /// no encoder.
  VideoWriter(const std::filesystem::path& file, int width, int height, int rate);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;
  /// Bytes R, G, B, 255. Throws std::runtime_error.
  void add(const std::vector<std::uint32_t>& colour);
  /// The file is none before. Throws std::runtime_error.
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
