// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Merge of chunks by message times, in bounded memory and in time linear in the file size.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "io/ros_recording.hpp"

namespace cairn {
namespace {

constexpr std::uint64_t kMostOpen = 256 << 20;  // bytes of overlapping chunks, besides the newest
constexpr int kMostOpened = 4;                  // times a chunk is unpacked

}  // namespace

std::uint64_t ChunkedRecording::Open::memory() const {
  return bytes.capacity() + places.capacity() * sizeof(Place) + sizeof(Open);
}

void ChunkedRecording::rewind() {
  open_.clear();
  given_ = {};
  memory_ = 0;
  is_beyond_bound_ = false;
  chunk_left_ = {};
  ended_early_.reset();
  to_come_.clear();
  for (const Chunk& chunk : index_) to_come_.emplace(ByTime{chunk.begin, chunk.at}, chunk);
  seek_record(0);
}

bool ChunkedRecording::are_in_order(const std::vector<Chunk>& chunks) {
  double latest = 0;
  bool in_order = true;
  for (const Chunk& chunk : chunks) {
    if (chunk.end == 0) continue;  // without messages, or times unknown
    in_order &= chunk.begin >= latest;
    latest = std::max(latest, chunk.end);
  }
  return in_order;
}

void ChunkedRecording::play_by(std::vector<Chunk> index) {
  std::sort(index.begin(), index.end(), [](const Chunk& a, const Chunk& b) { return a.at < b.at; });
  if (are_in_order(index)) return;
  // An index that lists a chunk twice, a partial chunk, or only some chunks would change the messages.
  std::vector<Chunk> all;
  try {
    all = walk();
  } catch (const std::runtime_error&) {
    // Damaged record header: `all` stays empty.
  }
  const bool is_whole = std::equal(index.begin(), index.end(), all.begin(), all.end(),
                                   [](const Chunk& a, const Chunk& b) { return a.at == b.at; });
  if (is_whole)
    index_ = std::move(index);
  else
    spdlog::warn(
        "{}: its chunks are not in time order, and its index does not name all of them: messages are read as they are "
        "in the file, and frames that come late are left out; write it in time order with `{}`",
        name(), sorting_command());
}

std::vector<std::uint8_t> ChunkedRecording::used_memory() { return std::exchange(spare_, {}); }

void ChunkedRecording::hold(std::vector<std::uint8_t> bytes) {
  Open open{.chunk = next_chunk_, .bytes = std::move(bytes), .places = {}, .damage = {}};
  open.chunk.at = record_at_;
  chunk_left_ = open.bytes;
  try {
    while (!chunk_left_.empty()) {
      const auto from = static_cast<std::uint32_t>(open.bytes.size() - chunk_left_.size());
      if (const auto message = message_in_chunk()) open.places.push_back({message->received, from});
    }
  } catch (const std::runtime_error& error) {
    open.damage = error.what();
  }
  chunk_left_ = {};
  const auto by_time = [](const Place& a, const Place& b) {
    return a.received != b.received ? a.received < b.received : a.from < b.from;
  };
  if (!std::is_sorted(open.places.begin(), open.places.end(), by_time))
    std::sort(open.places.begin(), open.places.end(), by_time);
  if (open.chunk.done >= open.places.size()) {
    if (open.damage) throw std::runtime_error(*open.damage);
    return;
  }
  memory_ += open.memory();
  const ByTime when{open.places[open.chunk.done].received, open.chunk.at};
  open_.emplace(when, std::move(open));
}

/// Advances past the last delivered message, since its bytes are no longer used.
void ChunkedRecording::leave_message() {
  if (given_.empty()) return;
  auto node = std::exchange(given_, {});
  Open& open = node.mapped();
  if (++open.chunk.done < open.places.size()) {
    node.key().first = open.places[open.chunk.done].received;
    open_.insert(std::move(node));
    return;
  }
  memory_ -= open.memory();
  spare_ = std::move(open.bytes);
  if (!open.damage) return;
  record_at_ = open.chunk.at;
  throw std::runtime_error(*open.damage);
}

/// True if no pending chunk has an earlier message than the open chunks.
bool ChunkedRecording::is_due() const {
  if (open_.empty()) return false;
  return is_beyond_bound_ || to_come_.empty() || open_.begin()->first < to_come_.begin()->first;
}

std::optional<RosMessage> ChunkedRecording::message_of_open() {
  given_ = open_.extract(open_.begin());
  const Open& open = given_.mapped();
  record_at_ = open.chunk.at;
  chunk_left_ = std::span(open.bytes).subspan(open.places[open.chunk.done].from);
  auto message = message_in_chunk();
  chunk_left_ = {};
  return message;
}

/// Reads the next record of the file or the next chunk of the index. False at the end.
bool ChunkedRecording::read_on(std::optional<RosMessage>& message) {
  is_beyond_bound_ = false;
  if (index_.empty()) return read_record(message);
  if (to_come_.empty()) return false;
  next_chunk_ = to_come_.extract(to_come_.begin()).mapped();
  ++next_chunk_.opened;
  seek_record(next_chunk_.at);
  record_at_ = next_chunk_.at;
  const bool is_there = read_record(message);
  next_chunk_ = {};
  if (!is_there || message) throw std::runtime_error("is not the chunk that it was: the file has changed since");
  keep_in_bound();
  return true;
}

/// Closes the chunks with the latest next messages; they are unpacked again later.
void ChunkedRecording::keep_in_bound() {
  while (!is_beyond_bound_ && memory_ > kMostOpen && open_.size() > 1) {
    const auto last = std::prev(open_.end());
    if (last->second.chunk.opened < kMostOpened) {
      const auto node = open_.extract(last);
      memory_ -= node.mapped().memory();
      to_come_.emplace(node.key(), node.mapped().chunk);
      continue;
    }
    is_beyond_bound_ = true;
    if (std::exchange(said_beyond_bound_, true)) return;
    spdlog::warn(
        "{}: more of its chunks overlap in time than {} MiB hold: messages are read out of order from byte {} on, and "
        "frames that come late are left out; write it in time order with `{}`",
        name(), kMostOpen >> 20, record_at_, sorting_command());
  }
}

std::optional<RosMessage> ChunkedRecording::next() {
  try {
    leave_message();
    for (;;) {
      std::optional<RosMessage> message;
      if (is_due())
        message = message_of_open();
      else if (!read_on(message))
        return std::nullopt;
      if (message) return message;
    }
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: the record at byte {}: {}", name(), record_at_, error.what()));
  }
}

}  // namespace cairn
