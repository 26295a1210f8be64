// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/mcap_writer.hpp"

#include <algorithm>
#include <bit>
#include <fstream>
#include <map>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/gzip.hpp"
#include "base/system_file.hpp"
#include "io/ros/mcap_records.hpp"
#include "io/ros/ros_compression.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace mcap;
static_assert(std::endian::native == std::endian::little, "numbers are written in memory byte order");

constexpr std::size_t kChunkSize = std::size_t{1} << 20;  // bytes, maximum loss if the process is killed
constexpr const char* kCompression = "zstd";

template <class T>
void put(std::string& to, T value) {
  to.append(reinterpret_cast<const char*>(&value), sizeof value);
}
void put_sized(std::string& to, std::string_view bytes) {
  put(to, static_cast<std::uint32_t>(bytes.size()));
  to += bytes;
}
void put_record(std::string& to, Kind kind, std::string_view data) {
  put(to, kind);
  put(to, static_cast<std::uint64_t>(data.size()));
  to += data;
}
/// Writes pairs of numbers with their total size.
template <class Pairs>
void put_pairs(std::string& to, const Pairs& pairs) {
  std::string bytes;
  for (const auto& [first, second] : pairs) {
    put(bytes, first);
    put(bytes, second);
  }
  put_sized(to, bytes);
}

/// Magic, and a header with the library name.
std::string first_bytes() {
  std::string begin(kMagic), header;
  put_sized(header, "");  // empty profile: topic names are free
  put_sized(header, "cairn");
  put_record(begin, kHeader, header);
  return begin;
}

/// Time range of a set of messages.
struct Times {
  std::uint64_t first = ~std::uint64_t{0}, last = 0;
  void add(std::uint64_t time) {
    first = std::min(first, time);
    last = std::max(last, time);
  }
  void put_to(std::string& to, bool any) const {
    put(to, any ? first : std::uint64_t{0});
    put(to, last);
  }
};

}  // namespace

struct McapWriter::State {
  /// By topic: message time, and offset in the chunk.
  using Index = std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>>;
  struct Chunk {
    std::string records;
    Times times;
    Index index;
  };
  void write(std::string_view bytes);
  void write_chunk();
  [[nodiscard]] std::string statistics() const;
  [[nodiscard]] std::string summary() const;

  fs::path name;
  std::unique_ptr<SystemFile> file;
  std::uint64_t size = 0;  // bytes of the file
  std::uint32_t crc = 0;   // of the bytes written so far
  Chunk chunk;
  Times times;
  std::vector<std::uint32_t> messages;           // counts by topic; index i has channel number i + 1
  std::string schemas, channels, chunk_indexes;  // records repeated in the summary
  std::uint32_t chunks = 0;
};

void McapWriter::State::write(std::string_view bytes) {
  try {
    file->write(bytes.data(), bytes.size());
  } catch (const SystemError& error) {
    (void)!ftruncate(file->descriptor(), static_cast<off_t>(size));
    throw std::runtime_error("cannot write " + name.string() + ": " + reason(error.number));
  }
  size += bytes.size();
  crc = crc32_of(bytes, crc);
}

void McapWriter::State::write_chunk() {
  if (chunk.records.empty()) return;
  const Chunk full = std::exchange(chunk, {});
  const std::string_view records = full.records;
  const auto compressed =
      compress_zstd(std::span(reinterpret_cast<const std::uint8_t*>(records.data()), records.size()));
  std::string data;
  full.times.put_to(data, !full.index.empty());
  put(data, static_cast<std::uint64_t>(records.size()));
  put(data, crc32_of(records));
  put_sized(data, kCompression);
  put(data, static_cast<std::uint64_t>(compressed.size()));
  data.append(reinterpret_cast<const char*>(compressed.data()), compressed.size());
  std::string bytes, about;
  put_record(bytes, kChunk, data);
  const std::uint64_t length = bytes.size();
  std::map<std::uint16_t, std::uint64_t> indexes;  // file offset by topic
  for (const auto& [topic, places] : full.index) {
    indexes[topic] = size + bytes.size();
    std::string index;
    put(index, topic);
    put_pairs(index, places);
    put_record(bytes, kMessageIndex, index);
  }
  full.times.put_to(about, !full.index.empty());
  put(about, size);
  put(about, length);
  put_pairs(about, indexes);
  put(about, static_cast<std::uint64_t>(bytes.size() - length));
  put_sized(about, kCompression);
  put(about, static_cast<std::uint64_t>(compressed.size()));
  put(about, static_cast<std::uint64_t>(records.size()));
  write(bytes);
  put_record(chunk_indexes, kChunkIndex, about);
  ++chunks;
}

std::string McapWriter::State::statistics() const {
  std::uint64_t all = 0;
  std::map<std::uint16_t, std::uint64_t> by_topic;
  for (std::size_t i = 0; i < messages.size(); ++i) all += by_topic[static_cast<std::uint16_t>(i + 1)] = messages[i];
  std::string data;
  put(data, all);
  put(data, static_cast<std::uint16_t>(messages.size()));  // schemas
  put(data, static_cast<std::uint32_t>(messages.size()));  // channels
  put(data, std::uint32_t{0});                             // attachments
  put(data, std::uint32_t{0});                             // metadata
  put(data, chunks);
  times.put_to(data, all > 0);
  put_pairs(data, by_topic);
  return data;
}

/// Builds the summary section with the footer, and the offsets of its record groups.
std::string McapWriter::State::summary() const {
  std::string bytes, offsets, numbers;
  put_record(numbers, kStatistics, statistics());
  const auto add = [&](Kind kind, const std::string& group) {
    if (group.empty()) return;
    std::string data;
    put(data, kind);
    put(data, static_cast<std::uint64_t>(size + bytes.size()));
    put(data, static_cast<std::uint64_t>(group.size()));
    put_record(offsets, kSummaryOffset, data);
    bytes += group;
  };
  add(kSchema, schemas);
  add(kChannel, channels);
  add(kStatistics, numbers);
  add(kChunkIndex, chunk_indexes);
  const std::uint64_t offsets_begin = size + bytes.size();
  bytes += offsets;
  put(bytes, kFooter);
  put(bytes, kFooterSize);
  put(bytes, size);
  put(bytes, offsets_begin);
  put(bytes, crc32_of(bytes));
  return bytes;
}

McapWriter::McapWriter(const fs::path& file) : state_(std::make_unique<State>()) {
  state_->name = file;
  try {
    state_->file = std::make_unique<SystemFile>(file, O_WRONLY | O_CREAT | O_EXCL);
  } catch (const SystemError& error) {
    throw std::runtime_error("cannot write " + file.string() + ": " + reason(error.number));
  }
  state_->write(first_bytes());
}

bool is_written_by_mcap_writer(const fs::path& file) {
  const std::string first = first_bytes();
  std::string found(first.size(), '\0');
  std::ifstream in(file, std::ios::binary);
  return in.read(found.data(), static_cast<std::streamsize>(found.size())) && found == first;
}

McapWriter::~McapWriter() = default;

std::uint16_t McapWriter::add(const McapTopic& topic) {
  State& s = *state_;
  s.messages.push_back(0);
  const auto number = static_cast<std::uint16_t>(s.messages.size());
  std::string schema, channel, records;
  put(schema, number);
  put_sized(schema, topic.schema);
  put_sized(schema, topic.schema_encoding);
  put_sized(schema, topic.schema_data);
  put(channel, number);
  put(channel, number);
  put_sized(channel, topic.name);
  put_sized(channel, topic.message_encoding);
  put_sized(channel, "");  // metadata
  for (std::string* to : {&s.chunk.records, &s.schemas}) put_record(*to, kSchema, schema);
  for (std::string* to : {&s.chunk.records, &s.channels}) put_record(*to, kChannel, channel);
  return number;
}

void McapWriter::write(std::uint16_t topic, std::uint64_t time, std::string_view message) {
  State& s = *state_;
  s.chunk.index[topic].emplace_back(time, s.chunk.records.size());
  s.chunk.times.add(time);
  s.times.add(time);
  std::string data;
  put(data, topic);
  put(data, s.messages.at(topic - std::size_t{1})++);
  put(data, time);
  put(data, time);
  put(s.chunk.records, kMessage);
  put(s.chunk.records, static_cast<std::uint64_t>(data.size() + message.size()));
  s.chunk.records.append(data).append(message);
  if (s.chunk.records.size() >= kChunkSize) s.write_chunk();
}

void McapWriter::finish() {
  State& s = *state_;
  s.write_chunk();
  std::string end, data;
  put(data, s.crc);
  put_record(end, kDataEnd, data);
  s.write(end);
  s.write(s.summary() + std::string(kMagic));
  try {
    s.file->close();
  } catch (const SystemError& error) {
    throw std::runtime_error("cannot write " + s.name.string() + ": " + reason(error.number));
  }
}

}  // namespace cairn
