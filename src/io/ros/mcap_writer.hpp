// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace cairn {

/// Message type of a topic.
struct McapTopic {
  std::string name;
  std::string message_encoding;  // for example "protobuf"
  std::string schema;            // schema name
  std::string schema_encoding;   // for example "protobuf"
  std::string schema_data;
};

/// Writes an MCAP file under its final name, chunk by chunk, so that the log stays usable if the program is killed.
/// Without the summary of a finished file, players still read the log, and `mcap recover` completes the file. After any
/// failure the file still ends with a complete record. https://mcap.dev/spec
class McapWriter {
 public:
  /// Creates the file. Throws std::runtime_error like write_whole, also if the file exists.
  explicit McapWriter(const std::filesystem::path& file);
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  /// Adds a topic and returns its channel number.
  [[nodiscard]] std::uint16_t add(const McapTopic& topic);
  /// Appends a message; `time` in nanoseconds. Throws std::runtime_error like write_whole; no further write succeeds
  /// afterwards.
  void write(std::uint16_t topic, std::uint64_t time, std::string_view message);
  /// Writes the last chunk and the summary. Throws std::runtime_error like write_whole.
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// True if the library name in the file's header is Cairn's.
[[nodiscard]] bool is_written_by_mcap_writer(const std::filesystem::path& file);

}  // namespace cairn
