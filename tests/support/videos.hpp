// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Writes containers and videos with FFmpeg's muxers and encoders.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace cairn {

/// Contents of a Matroska file; times have steps of 1 ms.
struct MatroskaFile {
  enum class Codec { mjpeg, raw, mpeg4, samples };
  struct Track {
    std::map<std::string, std::string> tags;  // `title` is the track's name
    Codec codec = Codec::raw;
    std::string fourcc;         // of Codec::raw: b16g, BGRA, NV12
    int width = 0, height = 0;  // pixels; 0 only for samples
    int rate = 0;               // Hz
  };
  struct Packet {
    int track;
    double time;  // seconds
    std::string bytes;
  };
  std::vector<Track> tracks;
  std::vector<Packet> packets;  // sorted by time
  std::map<std::string, std::string> tags;
  std::string attachment_name, attachment;  // none if the name is empty

  void write(const std::filesystem::path& file) const;
};

/// Encodes images (bytes R, G, B, 255) as an MP4 with bidirectional prediction, and a tag for rotation by 90 degrees.
/// `codec`: libx264, libx265, mpeg4.
void write_mp4(const std::filesystem::path& file, const std::vector<std::vector<std::uint32_t>>& images, int width,
               int height, int rate, const char* codec);

}  // namespace cairn
