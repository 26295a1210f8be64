// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// MCAP files: records with a kind and a length; messages are stored in chunks. The summary lists topics, counts, and
// the time range of each chunk; chunk headers repeat the time range. https://mcap.dev/spec
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <unordered_map>

#include "io/file_bytes.hpp"
#include "io/ros/mcap_records.hpp"
#include "io/ros/ros_compression.hpp"
#include "io/ros/ros_recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
static_assert(std::endian::native == std::endian::little, "numbers are read in the byte order of the file");
using Bytes = std::span<const std::uint8_t>;

using namespace mcap;

constexpr std::uint64_t kMaxRecordSize = 256ull << 20;  // bytes of a record

/// Sequential reader of a record's fields.
class Fields {
 public:
  explicit Fields(Bytes bytes) : left_(bytes) {}
  template <class T>
  T number() {
    T value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  std::string text() {
    const Bytes bytes = take(number<std::uint32_t>());
    return {bytes.begin(), bytes.end()};
  }
  Bytes take(std::uint64_t size) {
    if (size > left_.size()) throw std::runtime_error("a field is longer than its record");
    const Bytes field = left_.first(size);
    left_ = left_.subspan(size);
    return field;
  }
  [[nodiscard]] Bytes left() const { return left_; }

 private:
  Bytes left_;
};

double seconds_of(std::uint64_t nanoseconds) { return 1e-9 * static_cast<double>(nanoseconds); }

class McapFile final : public ChunkedRecording {
 public:
  explicit McapFile(const fs::path& file) : ChunkedRecording(file.string(), "MCAP file of ROS"), in_(file) {
    std::string begin(kMagic.size(), '\0');
    if (!in_.read(begin.data(), begin.size()) || begin != kMagic)
      throw std::runtime_error(fmt::format("{}: does not start like an MCAP file", name()));
    std::vector<Chunk> chunks;
    try {
      chunks = read_summary();
    } catch (const std::runtime_error&) {
      counts_.clear();  // read without the summary
    }
    for (const auto& [channel, messages] : counts_)
      if (const auto it = topic_of_channel_.find(channel); it != topic_of_channel_.end()) count(it->second, messages);
    if (chunks.empty()) chunks = list_chunks();
    // A channel may be defined only before its messages in file order, but playback by index changes the order.
    if (!has_all_channels_ && !are_in_order(chunks)) read_all();
    set_index(std::move(chunks));
    rewind();
  }

 private:
  struct RecordHead {
    std::uint8_t kind = 0;
    std::uint64_t size = 0;
  };

  /// Returns the header of the next record of the file; empty after the data or at a truncated end.
  std::optional<RecordHead> next_head() {
    record_at_ = in_.at();
    if (at_end_) return std::nullopt;
    RecordHead head;
    if (in_.read(&head.kind, 1) && in_.read(&head.size, 8) && head.size <= max_size(head)) {
      at_end_ = head.kind == kDataEnd || head.kind == kFooter;
      if (!at_end_) return head;
      return std::nullopt;
    }
    at_end_ = true;
    ended_early_ = fmt::format(
        "{}: is cut off or was never finished: the record at byte {} of {} is incomplete; earlier messages are read; "
        "copy it again, or use `mcap recover`",
        name(), record_at_, in_.size());
    return std::nullopt;
  }
  /// An uncompressed chunk may be truncated.
  [[nodiscard]] std::uint64_t max_size(RecordHead head) const { return head.kind == kChunk ? ~0ull : in_.left(); }

  Bytes read_data(std::uint64_t size) {
    if (size > kMaxRecordSize) throw std::runtime_error(fmt::format("has {} bytes, allowed: at most 256 MiB", size));
    data_.resize(size);
    if (!in_.read(data_.data(), size))
      throw std::runtime_error("cannot be read: the file has changed, or the disk is failing");
    return data_;
  }

  /// Reads topics, counts and chunks from the end of a finished file.
  std::vector<Chunk> read_summary() {
    std::vector<Chunk> chunks;
    if (in_.size() < 2 * kMagic.size() + kHeadSize + kFooterSize) return chunks;
    in_.seek(in_.size() - kMagic.size() - kFooterSize - kHeadSize);
    std::uint8_t kind = 0;
    std::uint64_t size = 0, summary = 0;
    if (!in_.read(&kind, 1) || !in_.read(&size, 8) || kind != kFooter || size != kFooterSize || !in_.read(&summary, 8))
      return chunks;
    if (summary == 0 || summary >= in_.size()) return chunks;
    in_.seek(summary);
    std::optional<std::uint32_t> channel_count;
    while (const auto head = next_head()) {
      const Bytes data = read_data(head->size);
      if (head->kind == kStatistics) {
        Fields fields(data);
        (void)fields.take(8 + 2);
        channel_count = fields.number<std::uint32_t>();
        (void)fields.take(3 * 4 + 2 * 8);
        Fields by_channel(fields.take(fields.number<std::uint32_t>()));
        for (const auto& [channel, topic] : topic_of_channel_) counts_[channel];
        while (!by_channel.left().empty()) {
          const auto channel = by_channel.number<std::uint16_t>();
          counts_[channel] = by_channel.number<std::uint64_t>();
        }
      } else if (head->kind == kChunkIndex) {
        chunks.push_back(chunk_of(Fields(data)));
      } else {
        add_definition(head->kind, data);
      }
    }
    has_all_channels_ = channel_count == topic_of_channel_.size();
    return chunks;
  }

  /// Learns the channels of all chunks.
  void read_all() {
    rewind();
    for (bool at_end = false; !at_end;) try {
        while (next()) {
        }
        at_end = true;
      } catch (const std::runtime_error&) {
        // Thrown again when the chunk is played.
      }
  }

  /// Chunk from an index record: times of its first and last message, and its position.
  static Chunk chunk_of(Fields fields) {
    const double begin = seconds_of(fields.number<std::uint64_t>()), end = seconds_of(fields.number<std::uint64_t>());
    return {.at = fields.number<std::uint64_t>(), .begin = begin, .end = end};
  }

  std::vector<Chunk> list_chunks() override {
    std::vector<Chunk> chunks;
    ended_early_.reset();
    seek_record(0);
    while (const auto head = next_head()) {
      const std::uint64_t end = in_.at() + std::min(head->size, in_.left());
      if (head->kind == kMessage || head->size > in_.left()) return {};
      if (head->kind == kChunk) {
        std::array<std::uint64_t, 2> times{};
        if (head->size > kMaxChunk || head->size < sizeof times || !in_.read(times.data(), sizeof times)) return {};
        chunks.push_back({.at = record_at_, .begin = seconds_of(times[0]), .end = seconds_of(times[1])});
      }
      in_.seek(end);
    }
    return ended_early_ ? std::vector<Chunk>{} : chunks;
  }
  void seek_record(std::uint64_t at) override {
    in_.seek(std::max<std::uint64_t>(at, kMagic.size()));
    at_end_ = false;
  }
  const char* sorting_command() const override { return "mcap sort IN.mcap -o OUT.mcap"; }

  /// Learns schemas, channels and counts from a record.
  void add_definition(std::uint8_t kind, Bytes data) {
    Fields fields(data);
    if (kind == kSchema) {
      const auto number = fields.number<std::uint16_t>();
      schemas_[number] = fields.text();
    } else if (kind == kChannel) {
      const auto number = fields.number<std::uint16_t>(), schema = fields.number<std::uint16_t>();
      const std::string topic = fields.text(), encoding = fields.text();
      if (topic_of_channel_.contains(number)) return;
      topic_of_channel_[number] = topic_of(topic, schemas_[schema],
                                           encoding == "ros1"  ? RosEncoding::ros1
                                           : encoding == "cdr" ? RosEncoding::cdr
                                                               : RosEncoding::unknown);
    }
  }

  std::optional<RosMessage> message_of(Bytes data) const {
    Fields fields(data);
    const auto topic = topic_of_channel_.find(fields.number<std::uint16_t>());
    (void)fields.number<std::uint32_t>();  // sequence number
    const double seconds = seconds_of(fields.number<std::uint64_t>());
    (void)fields.number<std::uint64_t>();  // publish time
    if (topic == topic_of_channel_.end()) return std::nullopt;
    return RosMessage{topic->second, seconds, record_at_, fields.left(), &name(), "byte"};
  }

  /// Returns the message in a record of the file, if any. Records of an uncompressed chunk that is truncated or very
  /// large are read one by one.
  std::optional<RosMessage> message_in_file(RecordHead head) {
    if (head.kind == kMessage) return message_of(read_data(head.size));
    if (head.kind == kSchema || head.kind == kChannel)
      add_definition(head.kind, read_data(head.size));
    else if (head.kind == kChunk)
      open_chunk(head.size);
    else
      in_.seek(in_.at() + head.size);
    return std::nullopt;
  }

  void open_chunk(std::uint64_t size) {
    const std::uint64_t begin = in_.at();
    std::array<std::uint8_t, 32> header{};  // first and last time, unpacked size, CRC, length of the compression name
    std::string kind;
    std::uint64_t records = 0;
    bool is_complete = in_.read(header.data(), header.size());
    Fields fields{Bytes(header)};
    (void)fields.take(16);
    const auto unpacked_size = fields.number<std::uint64_t>();
    (void)fields.take(4);
    kind.resize(std::min<std::uint32_t>(fields.number<std::uint32_t>(), 64));
    is_complete = is_complete && in_.read(kind.data(), kind.size()) && in_.read(&records, 8);
    const bool fits =
        is_complete && size <= in_.size() - begin && in_.at() - begin <= size && records <= begin + size - in_.at();
    if (is_complete && kind.empty() && (!fits || records > kMaxChunk)) return;
    if (!fits) {
      in_.seek(begin - kHeadSize);
      at_end_ = true;
      ended_early_ = fmt::format(
          "{}: is cut off or damaged in the chunk at byte {} of {}; earlier messages are read; copy it again, or use "
          "`mcap recover`",
          name(), record_at_, in_.size());
      return;
    }
    std::vector<std::uint8_t> bytes;
    if (kind.empty())
      bytes = read_chunk(records);
    else
      (void)read_data(records);
    in_.seek(begin + size);
    add_chunk(kind.empty() ? std::move(bytes) : unpacked(kind, data_, unpacked_size, spare_buffer()));
  }
  /// Reads the bytes of an uncompressed chunk.
  std::vector<std::uint8_t> read_chunk(std::uint64_t size) {
    auto bytes = spare_buffer();
    bytes.resize(size);
    if (!in_.read(bytes.data(), size))
      throw std::runtime_error("cannot be read: the file has changed, or the disk is failing");
    return bytes;
  }

  bool read_record(std::optional<RosMessage>& message) override {
    const auto head = next_head();
    if (head) message = message_in_file(*head);
    return head.has_value();
  }

  std::optional<RosMessage> message_in_chunk() override {
    Fields records(chunk_left_);
    const auto kind = records.number<std::uint8_t>();
    const Bytes data = records.take(records.number<std::uint64_t>());
    chunk_left_ = records.left();
    if (kind == kMessage) return message_of(data);
    add_definition(kind, data);
    return std::nullopt;
  }

  FileBytes in_;
  bool at_end_ = false, has_all_channels_ = false;
  std::vector<std::uint8_t> data_;
  std::unordered_map<std::uint16_t, std::string> schemas_;
  std::unordered_map<std::uint16_t, std::size_t> topic_of_channel_;
  std::map<std::uint16_t, std::uint64_t> counts_;  // message counts by channel
};

}  // namespace

std::unique_ptr<RosRecording> open_mcap(const fs::path& file) { return std::make_unique<McapFile>(file); }

}  // namespace cairn
