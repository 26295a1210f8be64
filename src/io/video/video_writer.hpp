// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

namespace cairn {

/// Writer of an MP4 file with one H.264 track, image by image.
class VideoWriter {
 public:
  /// Throws std::runtime_error if the file cannot be created, for odd image sizes, and if FFmpeg has no H.264 encoder.
  VideoWriter(const std::filesystem::path& file, int width, int height, int rate);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;
  /// Adds an image of bytes R, G, B, 255. Throws std::runtime_error.
  void add(const std::vector<std::uint32_t>& color);
  /// Completes the file; it is unreadable before. Throws std::runtime_error.
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
