// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Video containers (Matroska, MP4) and decoding of their tracks. All calls of FFmpeg's decoders are in video_file.cpp.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

struct AVCodecContext;
struct AVFormatContext;
struct AVFrame;
struct AVPacket;

namespace cairn {

using VideoTags = std::map<std::string, std::string>;

/// Packet of a track: an encoded image or other data.
class VideoPacket {
 public:
  VideoPacket(AVPacket* owned, double time);
  [[nodiscard]] int track() const;
  /// Time in seconds; -infinity if unknown.
  [[nodiscard]] double time() const { return time_; }
  /// Position in the file, bytes; -1 if unknown.
  [[nodiscard]] std::int64_t position() const;
  [[nodiscard]] std::span<const std::uint8_t> bytes() const;

 private:
  friend class VideoDecoder;
  friend class VideoFile;
  struct Free {
    void operator()(AVPacket* packet) const;
  };
  std::unique_ptr<AVPacket, Free> packet_;
  double time_;
};

/// Container file, read sequentially.
class VideoFile {
 public:
  enum class Format { matroska, mp4 };
  struct Track {
    bool is_video = false;
    std::string codec;          // FFmpeg's name: mjpeg, rawvideo, h264
    int width = 0, height = 0;  // pixels
    double interval = 0;        // seconds between images; 0: unknown
    VideoTags tags;
  };
  struct Attachment {
    VideoTags tags;
    std::string bytes;
  };

  /// Opens a file. Throws std::runtime_error with the file and its error. External files referenced by the container
  /// are not opened.
  VideoFile(const std::filesystem::path& file, Format format);
  [[nodiscard]] const std::vector<Track>& tracks() const { return tracks_; }
  [[nodiscard]] const std::vector<Attachment>& attachments() const { return attachments_; }
  [[nodiscard]] const VideoTags& tags() const { return tags_; }
  /// Returns the next packet of any track, or empty at the end. Throws on a read error.
  [[nodiscard]] std::optional<VideoPacket> next();

 private:
  friend class VideoDecoder;
  struct Close {
    void operator()(AVFormatContext* context) const;
  };
  std::string name_;
  std::unique_ptr<AVFormatContext, Close> context_;
  std::vector<Track> tracks_;
  std::vector<Attachment> attachments_;
  VideoTags tags_;
};

/// Decoded image, in sensor orientation: rotation tags for players are not applied.
class VideoImage {
 public:
  VideoImage(AVFrame* owned, double time) : frame_(owned), time_(time) {}
  /// Time of the packet, seconds.
  [[nodiscard]] double time() const { return time_; }
  [[nodiscard]] int width() const;
  [[nodiscard]] int height() const;
  /// Converts to bytes R, G, B, 255, row by row. Throws std::runtime_error for an unsupported pixel format.
  [[nodiscard]] std::vector<std::uint32_t> color() const;
  /// Returns 16-bit gray, row by row. Throws std::runtime_error for another pixel format.
  [[nodiscard]] std::vector<std::uint16_t> gray() const;

 private:
  friend class VideoDecoder;
  struct Free {
    void operator()(AVFrame* frame) const;
  };
  std::unique_ptr<AVFrame, Free> frame_;
  double time_;
};

/// Decoder of a track. Packets are fed in file order, images are returned in time order.
class VideoDecoder {
 public:
  /// Throws std::runtime_error with the reason if the track cannot be decoded.
  VideoDecoder(const VideoFile& file, int track);
  /// Feeds a packet. Throws std::runtime_error, without the file name, for a damaged packet; more packets may follow.
  void put(const VideoPacket& packet);
  /// Marks the end of the packets.
  void end();
  /// Returns the next image if available from the packets so far. Throws as put() does.
  [[nodiscard]] std::optional<VideoImage> next();

 private:
  struct Free {
    void operator()(AVCodecContext* context) const;
  };
  std::unique_ptr<AVCodecContext, Free> context_;
  double tick_;  // seconds
};

}  // namespace cairn
