// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Containers of ROS messages: what the readers of .bag, .mcap and .db3 files share.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace cairn {

/// How numbers and texts of a message lie in its bytes.
enum class RosEncoding { ros1, cdr, unknown };

struct RosTopic {
  std::string name, type;  // type as in ROS 1: sensor_msgs/Image
  RosEncoding encoding = RosEncoding::ros1;
  std::optional<std::uint64_t> messages;  // nothing where the file has no index
};

struct RosMessage {
  std::size_t topic;                    // of RosRecording::topics()
  double received;                      // seconds, when it was recorded
  std::uint64_t place;                  // in the file, see `unit`
  std::span<const std::uint8_t> bytes;  // until the next call
  const std::string* file;              // of the recording's
  const char* unit;                     // of `place`: byte or row
};

/// A recording, read in the order in which its messages were received, as far as its index tells that.
class RosRecording {
 public:
  /// `layout`: see Source.
  RosRecording(std::string name, std::string layout) : name_(std::move(name)), layout_(std::move(layout)) {}
  virtual ~RosRecording() = default;
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::string& layout() const { return layout_; }
  /// Those known so far; without an index more are found while messages are read.
  [[nodiscard]] const std::vector<RosTopic>& topics() const { return topics_; }
  /// The next message, or nothing at the end. Throws std::runtime_error with file and place for a damaged part; the
  /// next call goes on behind it.
  [[nodiscard]] virtual std::optional<RosMessage> next() = 0;
  /// Goes back to the begin.
  virtual void rewind() = 0;
  /// Why the recording ends before its time, once the end is reached, if it does.
  [[nodiscard]] const std::optional<std::string>& ended_early() const { return ended_early_; }

 protected:
  /// The number of a topic, which is a new one or known by its name. `type` as in ROS 1 or 2.
  std::size_t topic_of(std::string name, std::string type, RosEncoding encoding);
  void count(std::size_t topic, std::uint64_t messages);

  std::optional<std::string> ended_early_;

 private:
  std::string name_, layout_;
  std::vector<RosTopic> topics_;
  std::map<std::string, std::size_t> by_name_;
};

/// A chunk of a file as its index tells it. Times of zero are not known.
struct RosChunk {
  std::uint64_t at = 0;       // byte of the file
  double begin = 0, end = 0;  // seconds, when its first and its last message were received
  std::size_t done = 0;       // messages that were given
  int opened = 0;             // times
};

/// A file whose messages lie in chunks, and perhaps beside them. Chunks follow each other as in the file where they are
/// in time order or their times are not known, else they are merged by their times. The messages of a chunk are sorted.
class ChunkedRecording : public RosRecording {
 public:
  using RosRecording::RosRecording;
  [[nodiscard]] std::optional<RosMessage> next() final;
  void rewind() final;

 protected:
  using Chunk = RosChunk;
  static constexpr std::uint64_t kLargestChunk = 256 << 20;  // bytes, of a chunk that is sorted

  /// The next record of the chunk; takes it from chunk_left_. Nothing where it is no message.
  virtual std::optional<RosMessage> message_in_chunk() = 0;
  /// The next record of the file: a message, or a chunk, which is given to hold(), or neither. False at the end.
  virtual bool read_record(std::optional<RosMessage>& message) = 0;
  /// Goes to a record of the file, 0 to the first one.
  virtual void seek_record(std::uint64_t at) = 0;
  /// All chunks of the file by the heads of its records, with times as far as these tell them; nothing where messages
  /// are beside them, or a chunk is not whole or larger than kLargestChunk.
  virtual std::vector<Chunk> walk() = 0;
  /// Command that writes such a file in time order.
  [[nodiscard]] virtual const char* sorting_command() const = 0;

  /// Whether chunks, in the order of the file, follow each other in time.
  [[nodiscard]] static bool are_in_order(const std::vector<Chunk>& chunks);
  /// Merges these chunks by their times if they are not in order, and warns where that cannot be done.
  void play_by(std::vector<Chunk> index);
  /// Takes over the bytes of a chunk at record_at_.
  void hold(std::vector<std::uint8_t> bytes);
  /// Bytes of an earlier chunk, whose memory the next one takes: fresh memory costs as much time as unpacking.
  std::vector<std::uint8_t> used_memory();

  std::span<const std::uint8_t> chunk_left_;
  std::uint64_t record_at_ = 0;  // bytes; of the chunk for a message in one

 private:
  struct Place {
    double received;     // seconds
    std::uint32_t from;  // byte of the chunk
  };
  struct Open {
    Chunk chunk;
    std::vector<std::uint8_t> bytes;
    std::vector<Place> places;          // of its messages, in time order
    std::optional<std::string> damage;  // behind the messages
    [[nodiscard]] std::uint64_t memory() const;
  };
  using ByTime = std::pair<double, std::uint64_t>;  // seconds of a chunk's next message, byte of the file

  void leave_message();
  [[nodiscard]] bool is_due() const;
  std::optional<RosMessage> message_of_open();
  bool read_on(std::optional<RosMessage>& message);
  void keep_in_bound();

  std::vector<Chunk> index_;         // empty: chunks are read as in the file
  std::map<ByTime, Chunk> to_come_;  // of index_
  std::map<ByTime, Open> open_;
  std::map<ByTime, Open>::node_type given_;  // the last message's
  Chunk next_chunk_{};
  std::uint64_t memory_ = 0;  // bytes, of open_
  bool is_beyond_bound_ = false, said_beyond_bound_ = false;
  std::vector<std::uint8_t> spare_;
};

// Each reads one container. Throws std::runtime_error with what is wrong, where, and what to do.
[[nodiscard]] std::unique_ptr<RosRecording> open_ros1_bag(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<RosRecording> open_mcap(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<RosRecording> open_rosbag2_db3(const std::filesystem::path& file);
/// A folder with metadata.yaml, whose files are merged by their times.
[[nodiscard]] std::unique_ptr<RosRecording> open_rosbag2_folder(const std::filesystem::path& folder);
/// That of its name, see is_ros_recording().
[[nodiscard]] std::unique_ptr<RosRecording> open_ros_recording(const std::filesystem::path& name);

}  // namespace cairn
