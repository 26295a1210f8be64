// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Restricts served files to a folder.
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>

namespace cairn {

/// A regular file, open for reading.
class FileBelow {
 public:
  /// `name`: relative to `folder`. Follows no link below `folder` and does not wait for pipes or devices. Throws
  /// std::runtime_error with the file, the reason and the remedy.
  FileBelow(const std::filesystem::path& folder, const std::filesystem::path& name);
  ~FileBelow();
  FileBelow(const FileBelow&) = delete;
  FileBelow& operator=(const FileBelow&) = delete;
  /// Releases the descriptor to the caller, who closes it.
  [[nodiscard]] int release() { return std::exchange(descriptor_, -1); }
  /// All bytes. Throws std::runtime_error for more than `max_bytes`.
  [[nodiscard]] std::string read(std::size_t max_bytes) const;

 private:
  std::filesystem::path file_;
  int descriptor_ = -1;
};

/// Returns true if FileBelow can open the file. Links, pipes and devices are reported on the console.
[[nodiscard]] bool is_below(const std::filesystem::path& folder, const std::filesystem::path& name);

}  // namespace cairn
