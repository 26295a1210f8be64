// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Merge of chunks by message times, in bounded memory and in time linear in the file size.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "io/ros/ros_recording.hpp"

namespace cairn {
namespace {

constexpr std::uint64_t kMaxOpenBytes = 256 << 20;  // bytes of overlapping chunks, besides the newest
constexpr int kMaxOpenings = 4;                     // times a chunk is unpacked

}  // namespace

std::uint64_t ChunkedRecording::Open::memory() const {
  return bytes.capacity() + messages.capacity() * sizeof(MessagePosition) + sizeof(Open);
}

void ChunkedRecording::rewind() {
  open_.clear();
  current_ = {};
  memory_ = 0;
  exceeds_memory_ = false;
  chunk_left_ = {};
  ended_early_.reset();
  pending_.clear();
  for (const Chunk& chunk : index_) pending_.emplace(ByTime{chunk.begin, chunk.at}, chunk);
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

void ChunkedRecording::set_index(std::vector<Chunk> index) {
  std::sort(index.begin(), index.end(), [](const Chunk& a, const Chunk& b) { return a.at < b.at; });
  if (are_in_order(index)) return;
  // An index that lists a chunk twice, a partial chunk, or only some chunks would change the messages.
  std::vector<Chunk> all;
  try {
    all = list_chunks();
  } catch (const std::runtime_error&) {
    // Damaged record header: `all` stays empty.
  }
  const bool is_complete = std::equal(index.begin(), index.end(), all.begin(), all.end(),
                                      [](const Chunk& a, const Chunk& b) { return a.at == b.at; });
  if (is_complete)
    index_ = std::move(index);
  else
    spdlog::warn(
        "{}: its chunks are not in time order, and its index does not list all of them: messages are read in file "
        "order, and late frames are skipped; write it in time order with `{}`",
        name(), sorting_command());
}

std::vector<std::uint8_t> ChunkedRecording::spare_buffer() { return std::exchange(spare_, {}); }

void ChunkedRecording::add_chunk(std::vector<std::uint8_t> bytes) {
  Open open{.chunk = next_chunk_, .bytes = std::move(bytes), .messages = {}, .error = {}};
  open.chunk.at = record_at_;
  chunk_left_ = open.bytes;
  try {
    while (!chunk_left_.empty()) {
      const auto from = static_cast<std::uint32_t>(open.bytes.size() - chunk_left_.size());
      if (const auto message = message_in_chunk()) open.messages.push_back({message->received, from});
    }
  } catch (const std::runtime_error& error) {
    open.error = error.what();
  }
  chunk_left_ = {};
  const auto by_time = [](const MessagePosition& a, const MessagePosition& b) {
    return a.received != b.received ? a.received < b.received : a.from < b.from;
  };
  if (!std::is_sorted(open.messages.begin(), open.messages.end(), by_time))
    std::sort(open.messages.begin(), open.messages.end(), by_time);
  if (open.chunk.done >= open.messages.size()) {
    if (open.error) throw std::runtime_error(*open.error);
    return;
  }
  memory_ += open.memory();
  const ByTime when{open.messages[open.chunk.done].received, open.chunk.at};
  open_.emplace(when, std::move(open));
}

/// Advances past the last delivered message, since its bytes are no longer used.
void ChunkedRecording::close_message() {
  if (current_.empty()) return;
  auto node = std::exchange(current_, {});
  Open& open = node.mapped();
  if (++open.chunk.done < open.messages.size()) {
    node.key().first = open.messages[open.chunk.done].received;
    open_.insert(std::move(node));
    return;
  }
  memory_ -= open.memory();
  spare_ = std::move(open.bytes);
  if (!open.error) return;
  record_at_ = open.chunk.at;
  throw std::runtime_error(*open.error);
}

/// True if no pending chunk has an earlier message than the open chunks.
bool ChunkedRecording::is_due() const {
  if (open_.empty()) return false;
  return exceeds_memory_ || pending_.empty() || open_.begin()->first < pending_.begin()->first;
}

std::optional<RosMessage> ChunkedRecording::next_open_message() {
  current_ = open_.extract(open_.begin());
  const Open& open = current_.mapped();
  record_at_ = open.chunk.at;
  chunk_left_ = std::span(open.bytes).subspan(open.messages[open.chunk.done].from);
  auto message = message_in_chunk();
  chunk_left_ = {};
  return message;
}

/// Reads the next record of the file or the next chunk of the index. False at the end.
bool ChunkedRecording::read_next(std::optional<RosMessage>& message) {
  exceeds_memory_ = false;
  if (index_.empty()) return read_record(message);
  if (pending_.empty()) return false;
  next_chunk_ = pending_.extract(pending_.begin()).mapped();
  ++next_chunk_.opened;
  seek_record(next_chunk_.at);
  record_at_ = next_chunk_.at;
  const bool has_record = read_record(message);
  next_chunk_ = {};
  if (!has_record || message) throw std::runtime_error("is not the expected chunk: the file has changed");
  limit_memory();
  return true;
}

/// Closes the chunks with the latest next messages; they are unpacked again later.
void ChunkedRecording::limit_memory() {
  while (!exceeds_memory_ && memory_ > kMaxOpenBytes && open_.size() > 1) {
    const auto last = std::prev(open_.end());
    if (last->second.chunk.opened < kMaxOpenings) {
      const auto node = open_.extract(last);
      memory_ -= node.mapped().memory();
      pending_.emplace(node.key(), node.mapped().chunk);
      continue;
    }
    exceeds_memory_ = true;
    if (std::exchange(has_warned_, true)) return;
    spdlog::warn(
        "{}: its chunks that overlap in time need more than {} MiB: messages are read out of order from byte {} on, "
        "and late frames are skipped; write it in time order with `{}`",
        name(), kMaxOpenBytes >> 20, record_at_, sorting_command());
  }
}

std::optional<RosMessage> ChunkedRecording::next() {
  try {
    close_message();
    for (;;) {
      std::optional<RosMessage> message;
      if (is_due())
        message = next_open_message();
      else if (!read_next(message))
        return std::nullopt;
      if (message) return message;
    }
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: the record at byte {}: {}", name(), record_at_, error.what()));
  }
}

}  // namespace cairn
