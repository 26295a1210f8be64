// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Writes ROS recordings according to the specifications; shares no code with the readers.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/mapping/camera.hpp"

namespace cairn::ros {

/// ROS 1, or CDR of either byte order.
enum class Wire { ros1, little, big };

/// Serializes a message, field by field.
class MessageWriter {
 public:
  explicit MessageWriter(Wire wire);
  template <class T>
  MessageWriter& put(T value) {
    std::string raw(reinterpret_cast<const char*>(&value), sizeof value);
    if (wire_ == Wire::big) raw.assign(raw.rbegin(), raw.rend());
    while (wire_ != Wire::ros1 && (bytes_.size() - 4) % sizeof value != 0) bytes_ += '\0';
    bytes_ += raw;
    return *this;
  }
  MessageWriter& text(std::string_view text);
  MessageWriter& blob(std::string_view bytes);
  MessageWriter& header(std::int64_t stamp_ns, std::string_view frame);
  MessageWriter& vector(const Eigen::Vector3d& v);
  MessageWriter& transform(const Eigen::Isometry3d& pose);
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  Wire wire_;
  std::string bytes_;
};

struct ImageMessage {
  std::int64_t stamp = 0;  // ns
  std::string frame;
  int width = 0, height = 0;
  std::string encoding, data;
  int pixel_size = 0;  // bytes
  bool big_endian = false;
  int more_per_row = 0;  // bytes of row padding in data
};
[[nodiscard]] std::string image(Wire wire, const ImageMessage& m);
[[nodiscard]] std::string compressed_image(Wire wire, std::int64_t stamp, const std::string& frame,
                                           const std::string& format, const std::string& data);
/// `compressedDepth rvl` of depth in rows, packed as in the RVL paper.
[[nodiscard]] std::string rvl(const std::vector<std::uint16_t>& depth, int width);
/// K of the camera; P is twice as large, so that a reader's choice is visible.
[[nodiscard]] std::string camera_info(Wire wire, const std::string& frame, const Camera& camera,
                                      const std::string& model, const std::vector<double>& d);
[[nodiscard]] std::string imu(Wire wire, std::int64_t stamp, const std::string& frame, const Eigen::Vector3d& rate,
                              const Eigen::Vector3d& acceleration);
struct Transform {
  std::string parent, child;
  Eigen::Isometry3d parent_from_child;
};
[[nodiscard]] std::string tf(Wire wire, const std::vector<Transform>& transforms);

/// Message of a recording; files store messages in the given order.
struct Recorded {
  std::string topic, type;  // type as in ROS 1
  std::int64_t time = 0;    // ns, arrival time
  std::string bytes;
};
using Messages = std::vector<Recorded>;

struct Packed {
  std::string compression;    // .bag: bz2, lz4; .mcap: lz4, zstd; .db3: zstd; empty: none
  bool indexed = true;        // .bag and .mcap: finished; .db3: with an index by time
  bool times = true;          // chunk times; if false, zero for unknown
  bool summary = true;        // .mcap: with channels and chunks in the summary; if false, the footer has no summary
  std::size_t per_chunk = 5;  // messages; 0: outside of chunks
  int page_size = 4096;       // bytes, of a .db3
};
[[nodiscard]] std::string bag(const Messages& messages, const Packed& packed = {});
/// Serializes an MCAP file. `encoding`: ros1 or cdr.
[[nodiscard]] std::string mcap(const Messages& messages, const std::string& encoding, const Packed& packed = {});
void write_db3(const std::filesystem::path& file, const Messages& messages, const Packed& packed = {});

}  // namespace cairn::ros
