// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Video containers (Matroska, MP4) and what is encoded in them, by FFmpeg's libraries; the only door to these.
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

/// An encoded image or whatever else a track holds.
class VideoPacket {
 public:
  VideoPacket(AVPacket* owned, double time);
  [[nodiscard]] int track() const;
  /// Seconds; -infinity where the file does not tell.
  [[nodiscard]] double time() const { return time_; }
  /// Where it begins in the file, bytes; -1 where that is not known.
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

/// A container, read in order.
class VideoFile {
 public:
  enum class Format { matroska, mp4 };
  struct Track {
    bool is_video = false;
    std::string codec;          // as FFmpeg calls it: mjpeg, rawvideo, h264
    int width = 0, height = 0;  // pixels
    double interval = 0;        // seconds between images; 0: the file does not tell
    VideoTags tags;
  };
  struct Attachment {
    VideoTags tags;
    std::string bytes;
  };

  /// Throws std::runtime_error with the file and what is wrong with it. A file that refers to others does not open
  /// them.
  VideoFile(const std::filesystem::path& file, Format format);
  [[nodiscard]] const std::vector<Track>& tracks() const { return tracks_; }
  [[nodiscard]] const std::vector<Attachment>& attachments() const { return attachments_; }
  [[nodiscard]] const VideoTags& tags() const { return tags_; }
  /// The next packet of any track, or nothing at the end. Throws where the file cannot be read on.
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

/// A decoded image, as the sensor saw it: a rotation that the file asks players for is not applied.
class VideoImage {
 public:
  VideoImage(AVFrame* owned, double time) : frame_(owned), time_(time) {}
  /// That of its packet.
  [[nodiscard]] double time() const { return time_; }
  [[nodiscard]] int width() const;
  [[nodiscard]] int height() const;
  /// Bytes R, G, B, 255, row by row. Throws std::runtime_error for pixels that cannot be converted.
  [[nodiscard]] std::vector<std::uint32_t> colour() const;
  /// 16-bit grey, row by row. Throws std::runtime_error for an image of another kind.
  [[nodiscard]] std::vector<std::uint16_t> grey() const;

 private:
  friend class VideoDecoder;
  struct Free {
    void operator()(AVFrame* frame) const;
  };
  std::unique_ptr<AVFrame, Free> frame_;
  double time_;
};

/// The images of a track. Packets go in by their order in the file, images come out by their time.
class VideoDecoder {
 public:
  /// Throws std::runtime_error that says why not.
  VideoDecoder(const VideoFile& file, int track);
  /// Takes a packet. One that is damaged throws std::runtime_error that says so, without the file's name, and may be
  /// followed by others.
  void put(const VideoPacket& packet);
  /// No packet follows.
  void end();
  /// The next image, if the packets so far have one to give. Throws as put() does.
  [[nodiscard]] std::optional<VideoImage> next();

 private:
  struct Free {
    void operator()(AVCodecContext* context) const;
  };
  std::unique_ptr<AVCodecContext, Free> context_;
  double tick_;  // seconds
};

}  // namespace cairn
