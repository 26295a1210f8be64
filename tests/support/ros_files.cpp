// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/ros_files.hpp"

#include <bzlib.h>
#include <lz4frame.h>
#include <sqlite3.h>
#include <zstd.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

namespace cairn::ros {
namespace {

template <class T>
std::string raw(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}
std::string sized(const std::string& text) { return raw(static_cast<std::uint32_t>(text.size())) + text; }

std::string pack(const std::string& kind, const std::string& bytes) {
  std::string packed;
  if (kind.empty()) return bytes;
  if (kind == "lz4") {
    packed.resize(LZ4F_compressFrameBound(bytes.size(), nullptr));
    packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
  } else if (kind == "zstd") {
    packed.resize(ZSTD_compressBound(bytes.size()));
    packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1));
  } else if (kind == "bz2") {
    packed.resize(bytes.size() + bytes.size() / 100 + 600);
    auto size = static_cast<unsigned>(packed.size());
    BZ2_bzBuffToBuffCompress(packed.data(), &size, const_cast<char*>(bytes.data()), static_cast<unsigned>(bytes.size()),
                             1, 0, 0);
    packed.resize(size);
  } else {
    throw std::logic_error("no such packing");
  }
  return packed;
}

/// Number of each topic, in order of first appearance.
std::map<std::string, std::uint32_t> numbers_of(const Messages& messages) {
  std::map<std::string, std::uint32_t> numbers;
  for (const Recorded& m : messages) numbers.try_emplace(m.topic, static_cast<std::uint32_t>(numbers.size() + 1));
  return numbers;
}

using Field = std::pair<std::string, std::string>;
std::string bag_fields(const std::vector<Field>& fields) {
  std::string all;
  for (const auto& [name, value] : fields) all += sized(name + "=" + value);
  return all;
}
std::string bag_record(const std::vector<Field>& fields, const std::string& data) {
  return sized(bag_fields(fields)) + sized(data);
}
std::string bag_time(std::int64_t ns) {
  return raw(static_cast<std::uint32_t>(ns / 1'000'000'000)) + raw(static_cast<std::uint32_t>(ns % 1'000'000'000));
}
std::string connection(std::uint32_t number, const Recorded& m) {
  return bag_record(
      {{"op", "\x07"}, {"conn", raw(number)}, {"topic", m.topic}},
      bag_fields({{"topic", m.topic}, {"type", m.type}, {"md5sum", "*"}, {"message_definition", "# none"}}));
}

/// Times of the first and the last message of the chunk starting with message i.
std::pair<std::int64_t, std::int64_t> times_of(const Messages& messages, std::size_t i, const Packed& packed) {
  if (!packed.times) return {0, 0};
  std::pair<std::int64_t, std::int64_t> times{messages[i].time, messages[i].time};
  for (const std::size_t end = i + std::max<std::size_t>(packed.per_chunk, 1); i < messages.size() && i < end; ++i) {
    times.first = std::min(times.first, messages[i].time);
    times.second = std::max(times.second, messages[i].time);
  }
  return times;
}

std::string mcap_record(char kind, const std::string& content) {
  return std::string(1, kind) + raw(std::uint64_t{content.size()}) + content;
}
std::string mcap_channel(std::uint16_t number, const Recorded& m, const std::string& encoding) {
  std::string type = m.type;
  if (encoding == "cdr") type.insert(type.find('/'), "/msg");
  return mcap_record(3,
                     raw(number) + sized(type) + sized(encoding == "cdr" ? "ros2msg" : "ros1msg") + sized("# none")) +
         mcap_record(4, raw(number) + raw(number) + sized(m.topic) + sized(encoding) + sized(""));
}

}  // namespace

MessageWriter::MessageWriter(Wire wire) : wire_(wire) {
  if (wire == Wire::little) bytes_ = std::string("\0\1\0\0", 4);
  if (wire == Wire::big) bytes_ = std::string("\0\0\0\0", 4);
}
MessageWriter& MessageWriter::text(std::string_view text) {
  put(static_cast<std::uint32_t>(text.size() + (wire_ == Wire::ros1 ? 0 : 1)));
  bytes_ += text;
  if (wire_ != Wire::ros1) bytes_ += '\0';
  return *this;
}
MessageWriter& MessageWriter::blob(std::string_view bytes) {
  put(static_cast<std::uint32_t>(bytes.size()));
  bytes_ += bytes;
  return *this;
}
MessageWriter& MessageWriter::header(std::int64_t stamp_ns, std::string_view frame) {
  if (wire_ == Wire::ros1) put(std::uint32_t{7});
  put(static_cast<std::int32_t>(stamp_ns / 1'000'000'000));
  put(static_cast<std::uint32_t>(stamp_ns % 1'000'000'000));
  return text(frame);
}
MessageWriter& MessageWriter::vector(const Eigen::Vector3d& v) { return put(v.x()).put(v.y()).put(v.z()); }
MessageWriter& MessageWriter::transform(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond q(pose.linear());
  return vector(pose.translation()).put(q.x()).put(q.y()).put(q.z()).put(q.w());
}

std::string image(Wire wire, const ImageMessage& m) {
  MessageWriter w(wire);
  w.header(m.stamp, m.frame).put(static_cast<std::uint32_t>(m.height)).put(static_cast<std::uint32_t>(m.width));
  w.text(m.encoding).put(static_cast<std::uint8_t>(m.big_endian));
  return w.put(static_cast<std::uint32_t>(m.width * m.pixel_size + m.more_per_row)).blob(m.data).bytes();
}

std::string compressed_image(Wire wire, std::int64_t stamp, const std::string& frame, const std::string& format,
                             const std::string& data) {
  return MessageWriter(wire).header(stamp, frame).text(format).blob(data).bytes();
}

std::string rvl(const std::vector<std::uint16_t>& depth, int width) {
  std::string nibbles;
  const auto put = [&](std::uint32_t value) {
    do {
      nibbles += static_cast<char>((value & 7) | (value > 7 ? 8 : 0));
      value >>= 3;
    } while (value > 0);
  };
  int before = 0;
  for (std::size_t at = 0; at < depth.size();) {
    std::size_t zeros = 0, others = 0;
    while (at + zeros < depth.size() && depth[at + zeros] == 0) ++zeros;
    at += zeros;
    while (at + others < depth.size() && depth[at + others] != 0) ++others;
    put(static_cast<std::uint32_t>(zeros));
    put(static_cast<std::uint32_t>(others));
    for (; others > 0; --others, ++at) {
      const int step = depth[at] - before;
      put(static_cast<std::uint32_t>(step < 0 ? -2 * step - 1 : 2 * step));
      before = depth[at];
    }
  }
  nibbles.resize((nibbles.size() + 7) / 8 * 8);
  std::string bytes(12, '\0');
  const std::uint32_t size[2] = {static_cast<std::uint32_t>(width),
                                 static_cast<std::uint32_t>(depth.size()) / static_cast<std::uint32_t>(width)};
  bytes.append(reinterpret_cast<const char*>(size), sizeof size);
  for (std::size_t at = 0; at < nibbles.size(); at += 8)
    for (const std::size_t pair : {6, 4, 2, 0})
      bytes += static_cast<char>(nibbles[at + pair] << 4 | nibbles[at + pair + 1]);
  return bytes;
}

std::string camera_info(Wire wire, const std::string& frame, const Camera& c, const std::string& model,
                        const std::vector<double>& d) {
  MessageWriter w(wire);
  w.header(1'000'000'000, frame).put(static_cast<std::uint32_t>(c.height)).put(static_cast<std::uint32_t>(c.width));
  w.text(model).put(static_cast<std::uint32_t>(d.size()));
  for (const double value : d) w.put(value);
  for (const double value : {c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0}) w.put(value);
  for (const double value : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) w.put(value);
  for (const double value : {2 * c.fx, 0.0, c.cx, 0.0, 0.0, 2 * c.fy, c.cy, 0.0, 0.0, 0.0, 1.0, 0.0}) w.put(value);
  for (int i = 0; i < 6; ++i) w.put(std::uint32_t{0});  // binning, region of interest
  return w.put(std::uint8_t{0}).bytes();
}

std::string imu(Wire wire, std::int64_t stamp, const std::string& frame, const Eigen::Vector3d& rate,
                const Eigen::Vector3d& acceleration) {
  MessageWriter w(wire);
  w.header(stamp, frame);
  for (int i = 0; i < 4 + 9; ++i) w.put(0.0);
  w.vector(rate);
  for (int i = 0; i < 9; ++i) w.put(0.0);
  w.vector(acceleration);
  for (int i = 0; i < 9; ++i) w.put(0.0);
  return w.bytes();
}

std::string tf(Wire wire, const std::vector<Transform>& transforms) {
  MessageWriter w(wire);
  w.put(static_cast<std::uint32_t>(transforms.size()));
  for (const auto& t : transforms) w.header(0, t.parent).text(t.child).transform(t.parent_from_child);
  return w.bytes();
}

std::string bag(const Messages& messages, const Packed& packed) {
  const auto numbers = numbers_of(messages);
  std::map<std::string, bool> announced;
  std::string file = "#ROSBAG V2.0\n", infos, connections;
  const std::size_t head = file.size();
  file.resize(head + 4096);
  std::uint32_t chunks = 0;
  for (std::size_t i = 0; i < messages.size();) {
    std::string chunk;
    std::map<std::uint32_t, std::uint32_t> counts;
    const auto [begin, end_of_chunk] = times_of(messages, i, packed);
    for (const std::size_t end = i + std::max<std::size_t>(packed.per_chunk, 1); i < messages.size() && i < end; ++i) {
      const Recorded& m = messages[i];
      const std::uint32_t number = numbers.at(m.topic);
      if (!std::exchange(announced[m.topic], true)) {
        chunk += connection(number, m);
        connections += connection(number, m);
      }
      ++counts[number];
      chunk += bag_record({{"op", "\x02"}, {"conn", raw(number)}, {"time", bag_time(m.time)}}, m.bytes);
    }
    if (packed.per_chunk == 0) {
      file += chunk;
      continue;
    }
    std::string by_connection;
    for (const auto& [number, count] : counts) by_connection += raw(number) + raw(count);
    infos += bag_record({{"op", "\x06"},
                         {"ver", raw(1u)},
                         {"chunk_pos", raw(std::uint64_t{file.size()})},
                         {"start_time", bag_time(begin)},
                         {"end_time", bag_time(end_of_chunk)},
                         {"count", raw(static_cast<std::uint32_t>(counts.size()))}},
                        by_connection);
    ++chunks;
    file += bag_record({{"op", "\x05"},
                        {"compression", packed.compression.empty() ? "none" : packed.compression},
                        {"size", raw(static_cast<std::uint32_t>(chunk.size()))}},
                       pack(packed.compression, chunk));
    for (const auto& [number, count] : counts)
      file += bag_record({{"op", "\x04"}, {"ver", raw(1u)}, {"conn", raw(number)}, {"count", raw(count)}},
                         std::string(12 * count, '\0'));
  }
  const std::uint64_t index = packed.indexed ? file.size() : 0;
  if (packed.indexed) file += connections + infos;
  const std::string fields = bag_fields({{"op", "\x03"},
                                         {"index_pos", raw(index)},
                                         {"conn_count", raw(static_cast<std::uint32_t>(numbers.size()))},
                                         {"chunk_count", raw(chunks)}});
  return file.replace(head, 4096, sized(fields) + sized(std::string(4096 - 8 - fields.size(), ' ')));
}

std::string mcap(const Messages& messages, const std::string& encoding, const Packed& packed) {
  constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
  const auto numbers = numbers_of(messages);
  std::map<std::string, bool> announced;
  std::map<std::uint16_t, std::uint64_t> counts;
  std::string file(kMagic), channels, indices;
  std::uint32_t chunks = 0;
  file += mcap_record(1, sized(encoding == "cdr" ? "ros2" : "ros1") + sized("a test"));
  for (std::size_t i = 0; i < messages.size();) {
    std::string chunk;
    const auto [begin, end_of_chunk] = times_of(messages, i, packed);
    for (const std::size_t end = i + std::max<std::size_t>(packed.per_chunk, 1); i < messages.size() && i < end; ++i) {
      const Recorded& m = messages[i];
      const auto number = static_cast<std::uint16_t>(numbers.at(m.topic));
      if (!std::exchange(announced[m.topic], true)) {
        chunk += mcap_channel(number, m, encoding);
        channels += mcap_channel(number, m, encoding);
      }
      ++counts[number];
      chunk += mcap_record(5, raw(number) + raw(static_cast<std::uint32_t>(i)) + raw(m.time) + raw(m.time) + m.bytes);
    }
    if (packed.per_chunk == 0) {
      file += chunk;
      continue;
    }
    const std::string small = pack(packed.compression, chunk);
    const std::string record =
        mcap_record(6, raw(begin) + raw(end_of_chunk) + raw(std::uint64_t{chunk.size()}) + raw(0u) +
                           sized(packed.compression) + raw(std::uint64_t{small.size()}) + small);
    indices += mcap_record(8, raw(begin) + raw(end_of_chunk) + raw(std::uint64_t{file.size()}) +
                                  raw(std::uint64_t{record.size()}) + sized("") + raw(std::uint64_t{0}) +
                                  sized(packed.compression) + raw(std::uint64_t{small.size()}) +
                                  raw(std::uint64_t{chunk.size()}));
    ++chunks;
    file += record;
  }
  if (!packed.indexed) return file;
  file += mcap_record(15, raw(0u));
  const std::uint64_t summary = packed.summary ? file.size() : 0;
  std::string by_channel;
  for (const auto& [number, count] : counts) by_channel += raw(number) + raw(count);
  const auto channel_count = static_cast<std::uint32_t>(counts.size());
  if (packed.summary)
    file += channels +
            mcap_record(11, raw(std::uint64_t{messages.size()}) + raw(static_cast<std::uint16_t>(channel_count)) +
                                raw(channel_count) + raw(0u) + raw(0u) + raw(chunks) + std::string(16, '\0') +
                                sized(by_channel)) +
            indices;
  return file + mcap_record(2, raw(summary) + raw(std::uint64_t{0}) + raw(0u)) + std::string(kMagic);
}

void write_db3(const std::filesystem::path& file, const Messages& messages, const Packed& packed) {
  sqlite3* database = nullptr;
  sqlite3_open(file.c_str(), &database);
  const auto run = [&](const std::string& query, const std::string* blob = nullptr) {
    sqlite3_stmt* statement = nullptr;
    sqlite3_prepare_v2(database, query.c_str(), -1, &statement, nullptr);
    if (blob != nullptr) sqlite3_bind_blob(statement, 1, blob->data(), static_cast<int>(blob->size()), SQLITE_STATIC);
    const int result = sqlite3_step(statement);
    sqlite3_finalize(statement);
    if (result != SQLITE_DONE) throw std::logic_error(sqlite3_errmsg(database));
  };
  run("PRAGMA page_size = " + std::to_string(packed.page_size));
  run("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
      "NOT NULL, offered_qos_profiles TEXT NOT NULL)");
  run("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
      "NOT NULL)");
  if (packed.indexed) run("CREATE INDEX timestamp_idx ON messages (timestamp ASC)");
  run("BEGIN");
  const auto numbers = numbers_of(messages);
  std::map<std::string, bool> announced;
  for (const Recorded& m : messages) {
    const std::string number = std::to_string(numbers.at(m.topic));
    std::string type = m.type;
    type.insert(type.find('/'), "/msg");
    if (!std::exchange(announced[m.topic], true))
      run("INSERT INTO topics VALUES (" + number + ", '" + m.topic + "', '" + type + "', 'cdr', '')");
    const std::string bytes = pack(packed.compression, m.bytes);
    run("INSERT INTO messages(topic_id, timestamp, data) VALUES (" + number + ", " + std::to_string(m.time) + ", ?)",
        &bytes);
  }
  run("COMMIT");
  sqlite3_close(database);
}

}  // namespace cairn::ros
