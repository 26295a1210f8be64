// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Containers of ROS messages: common base of the readers of .bag, .mcap and .db3 files.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cairn {

/// Serialization format of messages.
enum class RosEncoding { ros1, cdr, unknown };

struct RosTopic {
  std::string name, type;  // type as in ROS 1: sensor_msgs/Image
  RosEncoding encoding = RosEncoding::ros1;
  std::optional<std::uint64_t> messages;  // empty if the file has no index
};

struct RosMessage {
  std::size_t topic;                    // index in RosRecording::topics()
  double received;                      // recording time, seconds
  std::uint64_t place;                  // position in the file, see `unit`
  std::span<const std::uint8_t> bytes;  // valid until the next call
  const std::string* file;              // file name, owned by the recording
  const char* unit;                     // unit of `place`: byte or row
};

/// Recording, read in order of message reception as far as its index allows.
class RosRecording {
 public:
  /// `layout`: see Source.
  RosRecording(std::string name, std::string layout) : name_(std::move(name)), layout_(std::move(layout)) {}
  virtual ~RosRecording() = default;
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::string& layout() const { return layout_; }
  /// Topics known so far; without an index, more are found while reading.
  [[nodiscard]] const std::vector<RosTopic>& topics() const { return topics_; }
  /// Returns the next message, or empty at the end. Throws std::runtime_error with file and place for a damaged part;
  /// the next call continues after it.
  [[nodiscard]] virtual std::optional<RosMessage> next() = 0;
  /// Rewinds to the first message.
  virtual void rewind() = 0;
  /// True for running topics: next() then waits for a message.
  [[nodiscard]] virtual bool is_live() const { return false; }
  /// Limits running topics to these; the first is the depth topic. From then on next() throws std::runtime_error each
  /// second without a depth image.
  virtual void follow(const std::vector<std::size_t>& /*topics*/) {}
  /// Reason for a premature end of the recording, set at the end.
  [[nodiscard]] const std::optional<std::string>& ended_early() const { return ended_early_; }

 protected:
  /// Returns the index of a topic by name, after adding it if new. `type` as in ROS 1 or 2.
  std::size_t topic_of(std::string name, std::string type, RosEncoding encoding);
  void count(std::size_t topic, std::uint64_t messages);

  std::optional<std::string> ended_early_;

 private:
  std::string name_, layout_;
  std::vector<RosTopic> topics_;
  std::map<std::string, std::size_t> by_name_;
};

/// Chunk of a file, from its index. A time of zero is unknown.
struct RosChunk {
  std::uint64_t at = 0;       // byte of the file
  double begin = 0, end = 0;  // seconds, reception of the first and the last message
  std::size_t done = 0;       // delivered messages
  int opened = 0;             // number of times
};

/// File with messages in chunks, and perhaps outside of them. Chunks in time order, or with unknown times, are read in
/// file order; other chunks are merged by time. Messages within a chunk are sorted by time.
class ChunkedRecording : public RosRecording {
 public:
  using RosRecording::RosRecording;
  [[nodiscard]] std::optional<RosMessage> next() final;
  void rewind() final;

 protected:
  using Chunk = RosChunk;
  static constexpr std::uint64_t kMaxChunk = 256 << 20;  // bytes, of a chunk with sorted messages

  /// Reads the next record of the chunk and removes it from chunk_left_. Empty if the record is no message.
  virtual std::optional<RosMessage> message_in_chunk() = 0;
  /// Reads the next record of the file: a message, a chunk (passed to hold()), or another record. False at the end.
  virtual bool read_record(std::optional<RosMessage>& message) = 0;
  /// Seeks to a record of the file, 0: the first record.
  virtual void seek_record(std::uint64_t at) = 0;
  /// Lists all chunks by the record headers of the file, with times as far as known; empty if messages are outside of
  /// chunks, or a chunk is truncated or larger than kMaxChunk.
  virtual std::vector<Chunk> list_chunks() = 0;
  /// Command to rewrite a file in time order.
  [[nodiscard]] virtual const char* sorting_command() const = 0;

  /// True if chunks in file order are in time order.
  [[nodiscard]] static bool are_in_order(const std::vector<Chunk>& chunks);
  /// Merges the chunks by time if they are out of order, and warns if merging is impossible.
  void set_index(std::vector<Chunk> index);
  /// Takes ownership of the bytes of a chunk at record_at_.
  void add_chunk(std::vector<std::uint8_t> bytes);
  /// Returns the buffer of an earlier chunk for reuse: allocating fresh memory takes as long as decompressing.
  std::vector<std::uint8_t> spare_buffer();

  std::span<const std::uint8_t> chunk_left_;
  std::uint64_t record_at_ = 0;  // bytes; for a message in a chunk, the chunk's position

 private:
  struct MessagePosition {
    double received;     // seconds
    std::uint32_t from;  // byte of the chunk
  };
  struct Open {
    Chunk chunk;
    std::vector<std::uint8_t> bytes;
    std::vector<MessagePosition> messages;  // of its messages, in time order
    std::optional<std::string> error;       // after the messages
    [[nodiscard]] std::uint64_t memory() const;
  };
  using ByTime = std::pair<double, std::uint64_t>;  // seconds of a chunk's next message, byte of the file

  void close_message();
  [[nodiscard]] bool is_due() const;
  std::optional<RosMessage> next_open_message();
  bool read_next(std::optional<RosMessage>& message);
  void limit_memory();

  std::vector<Chunk> index_;         // empty: chunks are read in file order
  std::map<ByTime, Chunk> pending_;  // pending chunks of index_
  std::map<ByTime, Open> open_;
  std::map<ByTime, Open>::node_type current_;  // chunk of the last message
  Chunk next_chunk_{};
  std::uint64_t memory_ = 0;  // bytes used by open_
  bool exceeds_memory_ = false, has_warned_ = false;
  std::vector<std::uint8_t> spare_;
};

// Each function opens one container format. Throws std::runtime_error with the problem, its place and a remedy.
[[nodiscard]] std::unique_ptr<RosRecording> open_ros1_bag(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<RosRecording> open_mcap(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<RosRecording> open_rosbag2_db3(const std::filesystem::path& file);
/// Opens a folder with metadata.yaml; its files are merged by time.
[[nodiscard]] std::unique_ptr<RosRecording> open_rosbag2_folder(const std::filesystem::path& folder);
/// Topics of a running ROS 2 graph; `name`: `ros2:` (domain ROS_DOMAIN_ID, else 0) or `ros2:DOMAIN`. Returns after the
/// first image; next() is empty two seconds later, at the end of the survey, until follow() is called. `compressed`:
/// compressed topics to read although their raw images are published too; nullopt: all. Throws std::runtime_error with
/// the cause and the remedy, also without an image within five seconds.
[[nodiscard]] std::unique_ptr<RosRecording> open_ros2(std::string_view name,
                                                      std::optional<std::vector<std::string>> compressed = {});
inline constexpr std::string_view kRos2 = "ros2:";
/// Domain of such a name. Throws std::runtime_error if it is none.
[[nodiscard]] std::uint32_t ros2_domain(std::string_view name);
/// Running depth topics. Throws std::runtime_error without a usable Cyclone DDS.
[[nodiscard]] std::vector<std::string> ros2_depth_topics();
/// Opens the container of this name, see is_ros_recording().
[[nodiscard]] std::unique_ptr<RosRecording> open_ros_recording(const std::filesystem::path& name);

}  // namespace cairn
