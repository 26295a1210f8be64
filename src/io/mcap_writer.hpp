// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace cairn {

/// What the messages of a topic are.
struct McapTopic {
  std::string name;
  std::string message_encoding;  // "protobuf"
  std::string schema;            // its name
  std::string schema_encoding;   // "protobuf"
  std::string schema_data;
};

/// Writes an MCAP file under its own name, chunk by chunk as messages come: a log is of use when its program was
/// killed. Such a file lacks its summary; players read it all the same, and `mcap recover` writes it whole. Whatever
/// fails, a file ends with a whole record. https://mcap.dev/spec
class McapWriter {
 public:
  /// A new file. Throws std::runtime_error like write_whole, also where there is a file already.
  explicit McapWriter(const std::filesystem::path& file);
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  /// The topic's number.
  [[nodiscard]] std::uint16_t add(const McapTopic& topic);
  /// `time`: nanoseconds. Throws std::runtime_error like write_whole; nothing can be written then any more.
  void write(std::uint16_t topic, std::uint64_t time, std::string_view message);
  /// Writes what is left, and the summary. Throws std::runtime_error like write_whole.
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// By a file's header, which names the library that wrote it.
[[nodiscard]] bool is_written_by_mcap_writer(const std::filesystem::path& file);

}  // namespace cairn
