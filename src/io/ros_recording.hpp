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

/// A recording, read in order. Only one chunk of it is held at a time.
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

/// A file whose messages lie in chunks, and perhaps beside them.
class ChunkedRecording : public RosRecording {
 public:
  using RosRecording::RosRecording;
  [[nodiscard]] std::optional<RosMessage> next() final;

 protected:
  /// The next record of the chunk; takes it from chunk_left_. Nothing where it is no message.
  virtual std::optional<RosMessage> message_in_chunk() = 0;
  /// The next record of the file: a message, or a chunk, or neither. False at the end.
  virtual bool read_record(std::optional<RosMessage>& message) = 0;

  std::span<const std::uint8_t> chunk_left_;
  std::uint64_t record_at_ = 0;  // bytes; of the chunk for a message in one
};

// Each reads one container. Throws std::runtime_error with what is wrong, where, and what to do.
[[nodiscard]] std::unique_ptr<RosRecording> open_ros1_bag(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<RosRecording> open_mcap(const std::filesystem::path& file);
[[nodiscard]] std::unique_ptr<RosRecording> open_rosbag2_db3(const std::filesystem::path& file);
/// A folder with metadata.yaml, whose files follow each other.
[[nodiscard]] std::unique_ptr<RosRecording> open_rosbag2_folder(const std::filesystem::path& folder);
/// That of its name, see is_ros_recording().
[[nodiscard]] std::unique_ptr<RosRecording> open_ros_recording(const std::filesystem::path& name);

}  // namespace cairn
