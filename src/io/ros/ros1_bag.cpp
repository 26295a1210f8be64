// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// ROS 1 bags, format 2.0: records of a header with named fields, and data; messages are stored in chunks. The index
// lists topics, counts, and the time range of each chunk. http://wiki.ros.org/Bags/Format/2.0
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <unordered_map>

#include "io/file_bytes.hpp"
#include "io/ros/ros_compression.hpp"
#include "io/ros/ros_recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
static_assert(std::endian::native == std::endian::little, "numbers are read in the byte order of the file");
using Bytes = std::span<const std::uint8_t>;

constexpr std::string_view kBegin = "#ROSBAG V2.0\n";
constexpr std::uint32_t kMaxHeader = 1 << 20;  // bytes
enum Op : std::uint8_t { kMessage = 2, kBag = 3, kChunk = 5, kChunkInfo = 6, kConnection = 7 };

template <class T>
std::optional<T> number_at(Bytes bytes, std::size_t at = 0) {
  T value;
  if (bytes.size() < at + sizeof value) return std::nullopt;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}
/// Converts a time of seconds and nanoseconds.
double seconds_of(std::uint64_t time) {
  return static_cast<double>(time & 0xffffffff) + 1e-9 * static_cast<double>(time >> 32);
}
std::string_view text_of(Bytes bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

/// Fields of a record header, each a length and `name=value`.
class Fields {
 public:
  explicit Fields(Bytes bytes) {
    while (!bytes.empty()) {
      const auto length = number_at<std::uint32_t>(bytes);
      if (!length || *length > bytes.size() - 4) throw std::runtime_error("a field is longer than its header");
      const Bytes field = bytes.subspan(4, *length);
      const std::size_t equals = text_of(field).find('=');
      if (equals == std::string_view::npos) throw std::runtime_error("a field has no name");
      all_.emplace_back(text_of(field).substr(0, equals), field.subspan(equals + 1));
      bytes = bytes.subspan(4 + *length);
    }
  }
  [[nodiscard]] Bytes bytes(std::string_view name) const {
    for (const auto& [n, value] : all_)
      if (n == name) return value;
    throw std::runtime_error(fmt::format("the field `{}` is missing", name));
  }
  template <class T>
  [[nodiscard]] T number(std::string_view name) const {
    const auto value = number_at<T>(bytes(name));
    if (!value) throw std::runtime_error(fmt::format("the field `{}` is too short", name));
    return *value;
  }

 private:
  std::vector<std::pair<std::string_view, Bytes>> all_;
};

class Ros1Bag final : public ChunkedRecording {
 public:
  explicit Ros1Bag(const fs::path& file) : ChunkedRecording(file.string(), "ROS 1 bag"), in_(file) {
    std::string begin(kBegin.size(), '\0');
    if (!in_.read(begin.data(), begin.size()) || begin != kBegin)
      throw std::runtime_error(
          fmt::format("{}: does not start like a ROS 1 bag of format 2.0; `rosbag fix` converts older bags", name()));
    end_ = in_.size();
    try {
      read_index();
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(fmt::format("{}: the record at byte {}: {}", name(), record_at_, error.what()));
    }
    rewind();
  }

 private:
  struct RecordHead {
    std::uint32_t data_size;
  };

  /// Reads the header of the file's next record into header_; empty at the end or at a truncation.
  std::optional<RecordHead> next_head() {
    record_at_ = in_.at();
    if (in_.at() == end_) {
      if (!index_found_ && !ended_early_) ended_early_ = no_index_message();
      return std::nullopt;
    }
    std::uint32_t header_size = 0, data_size = 0;
    const bool is_complete = in_.read(&header_size, 4) && header_size <= kMaxHeader && read_header(header_size) &&
                             in_.read(&data_size, 4) && (data_size <= in_.left() || is_uncompressed_chunk());
    if (is_complete) return RecordHead{data_size};
    in_.seek(end_);
    ended_early_ = fmt::format(
        "{}: is cut off or damaged in the record at byte {} of {}; earlier messages are read; copy it again, or repair "
        "it with `rosbag reindex`",
        name(), record_at_, in_.size());
    return std::nullopt;
  }
  bool read_header(std::uint32_t size) {
    header_.resize(size);
    return in_.read(header_.data(), size);
  }
  std::vector<std::uint8_t>& read_data(std::uint32_t size) {
    data_.resize(size);
    if (!in_.read(data_.data(), size))
      throw std::runtime_error("cannot be read: the file has changed, or the disk is failing");
    return data_;
  }
  /// Reads the bytes of an uncompressed chunk.
  std::vector<std::uint8_t> read_chunk(std::uint32_t size) {
    auto bytes = spare_buffer();
    bytes.resize(size);
    if (!in_.read(bytes.data(), size))
      throw std::runtime_error("cannot be read: the file has changed, or the disk is failing");
    return bytes;
  }
  /// True for an uncompressed chunk; it may be truncated.
  [[nodiscard]] bool is_uncompressed_chunk() const {
    const Fields fields(header_);
    return fields.number<std::uint8_t>("op") == kChunk && text_of(fields.bytes("compression")) == "none";
  }
  [[nodiscard]] std::string no_index_message() const {
    return fmt::format(
        "{}: has no index, so its recording was never finished; all messages are read; repair it "
        "with `rosbag reindex`",
        name());
  }

  /// Reads the connections and counts at the end of a finished bag.
  void read_index() {
    const auto head = next_head();
    if (!head) throw std::runtime_error("is cut off or damaged; copy the file again");
    const Fields bag(header_);
    if (bag.number<std::uint8_t>("op") != kBag) throw std::runtime_error("is not the header of a bag");
    const auto index = bag.number<std::uint64_t>("index_pos");
    if (index == 0 || index >= in_.size()) return;
    in_.seek(index);
    index_found_ = true;
    std::unordered_map<std::uint32_t, std::uint64_t> counts;
    std::vector<Chunk> chunks;
    while (const auto record = next_head()) {
      const Fields fields(header_);
      const Bytes data = read_data(record->data_size);
      const auto op = fields.number<std::uint8_t>("op");
      if (op == kConnection) add_connection(fields, data);
      if (op != kChunkInfo) continue;
      chunks.push_back({.at = fields.number<std::uint64_t>("chunk_pos"),
                        .begin = seconds_of(fields.number<std::uint64_t>("start_time")),
                        .end = seconds_of(fields.number<std::uint64_t>("end_time"))});
      for (std::size_t at = 0; at + 8 <= data.size(); at += 8)
        counts[*number_at<std::uint32_t>(data, at)] += *number_at<std::uint32_t>(data, at + 4);
    }
    index_found_ = !ended_early_;
    if (!index_found_) return;  // no counts without the complete index
    for (const auto& [connection, topic] : topic_of_connection_) count(topic, counts[connection]);
    end_ = index;
    set_index(std::move(chunks));
  }

  std::vector<Chunk> list_chunks() override {
    std::vector<Chunk> chunks;
    for (seek_record(0);;) {
      const std::uint64_t at = in_.at();
      const auto head = next_head();
      if (!head) return ended_early_ ? std::vector<Chunk>{} : chunks;
      const auto op = Fields(header_).number<std::uint8_t>("op");
      const bool is_chunk = op == kChunk;
      if (op == kMessage || head->data_size > in_.left() || (is_chunk && head->data_size > kMaxChunk)) return {};
      if (is_chunk) chunks.push_back({.at = at, .begin = 0, .end = 0});
      in_.seek(in_.at() + head->data_size);
    }
  }
  void seek_record(std::uint64_t at) override { in_.seek(std::max<std::uint64_t>(at, kBegin.size())); }
  const char* sorting_command() const override { return "rosbag filter IN.bag OUT.bag True"; }

  void add_connection(const Fields& fields, Bytes data) {
    const auto number = fields.number<std::uint32_t>("conn");
    if (topic_of_connection_.contains(number)) return;
    topic_of_connection_[number] = topic_of(std::string(text_of(fields.bytes("topic"))),
                                            std::string(text_of(Fields(data).bytes("type"))), RosEncoding::ros1);
  }

  std::optional<RosMessage> message_of(const Fields& fields, Bytes data) const {
    const auto topic = topic_of_connection_.find(fields.number<std::uint32_t>("conn"));
    if (topic == topic_of_connection_.end()) return std::nullopt;
    return RosMessage{topic->second, seconds_of(fields.number<std::uint64_t>("time")), record_at_, data, &name(),
                      "byte"};
  }

  /// Returns the message in a record of the file, if any. Records of an uncompressed chunk that is truncated or very
  /// large are read one by one.
  std::optional<RosMessage> message_in_file(RecordHead head) {
    const std::uint64_t end = std::min(in_.at() + head.data_size, in_.size());
    try {
      const Fields fields(header_);
      const auto op = fields.number<std::uint8_t>("op");
      if (op == kMessage) return message_of(fields, read_data(head.data_size));
      if (op == kConnection) add_connection(fields, read_data(head.data_size));
      if (op == kChunk) {
        const auto kind = text_of(fields.bytes("compression"));
        if (kind != "none") {
          add_chunk(unpacked(kind, read_data(head.data_size), fields.number<std::uint32_t>("size"), spare_buffer()));
        } else {
          if (end - in_.at() < head.data_size || head.data_size > kMaxChunk) return std::nullopt;
          add_chunk(read_chunk(head.data_size));
        }
      }
    } catch (const std::runtime_error&) {
      in_.seek(end);
      throw;
    }
    in_.seek(end);
    return std::nullopt;
  }

  bool read_record(std::optional<RosMessage>& message) override {
    const auto head = next_head();
    if (head) message = message_in_file(*head);
    return head.has_value();
  }

  std::optional<RosMessage> message_in_chunk() override {
    const auto take = [&] {
      const auto size = number_at<std::uint32_t>(chunk_left_);
      if (!size || *size > chunk_left_.size() - 4) throw std::runtime_error("its chunk ends within a record");
      const Bytes taken = chunk_left_.subspan(4, *size);
      chunk_left_ = chunk_left_.subspan(4 + *size);
      return taken;
    };
    const Fields fields(take());
    const Bytes data = take();
    const auto op = fields.number<std::uint8_t>("op");
    if (op == kConnection) add_connection(fields, data);
    return op == kMessage ? message_of(fields, data) : std::nullopt;
  }

  FileBytes in_;
  std::uint64_t end_ = 0;  // bytes
  bool index_found_ = false;
  std::vector<std::uint8_t> header_, data_;
  std::unordered_map<std::uint32_t, std::size_t> topic_of_connection_;
};

}  // namespace

std::unique_ptr<RosRecording> open_ros1_bag(const fs::path& file) { return std::make_unique<Ros1Bag>(file); }

}  // namespace cairn
