// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <ostream>
#include <string_view>

namespace cairn {

/// Temporary bytes on disk, to save memory, in an unnamed file that disappears with the program.
class Spool {
 public:
  /// Creates the spool on the disk of `file`. Throws std::runtime_error as write_whole does.
  explicit Spool(const std::filesystem::path& file);
  ~Spool();
  Spool(Spool&&) noexcept;
  /// Throws std::runtime_error as write_whole does.
  void append(std::string_view bytes);
  /// Copies all bytes. Throws std::runtime_error with the system's reason; write_whole adds the path.
  void copy_to(std::ostream& out) const;
  /// Maps all bytes written so far into memory: pages are loaded on access and dropped under memory pressure. Valid
  /// during the spool's lifetime; later bytes are not included. Throws std::runtime_error with the system's reason.
  [[nodiscard]] std::string_view mapped();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
