// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <ostream>
#include <string_view>

namespace cairn {

/// Bytes that wait on the disk instead of in memory until they are wanted: in a file without a name, which is gone when
/// the program is.
class Spool {
 public:
  /// On the disk that `file` will be on. Throws std::runtime_error like write_whole.
  explicit Spool(const std::filesystem::path& file);
  ~Spool();
  Spool(Spool&&) noexcept;
  /// Throws std::runtime_error like write_whole.
  void append(std::string_view bytes);
  /// All of it. Throws std::runtime_error with the system's reason, to which write_whole adds the path.
  void copy_to(std::ostream& out) const;
  /// All of it, in pages that the system reads when they are looked at and drops when memory is short; as long as this
  /// lives. What is appended later is not in it. Throws std::runtime_error with the system's reason.
  [[nodiscard]] std::string_view mapped();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
