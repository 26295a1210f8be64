// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files that a server gives: of the folder that is shown, and of no other.
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>

namespace cairn {

/// A regular file, open to be read.
class FileBelow {
 public:
  /// `name`: relative to `folder`. Follows no link below `folder`, and waits for no pipe or device. Throws
  /// std::runtime_error with the file, the reason and the remedy.
  FileBelow(const std::filesystem::path& folder, const std::filesystem::path& name);
  ~FileBelow();
  FileBelow(const FileBelow&) = delete;
  FileBelow& operator=(const FileBelow&) = delete;
  /// The descriptor, which the caller closes from now on.
  [[nodiscard]] int release() { return std::exchange(descriptor_, -1); }
  /// All bytes. Throws std::runtime_error for more than `most`.
  [[nodiscard]] std::string read(std::size_t most) const;

 private:
  std::filesystem::path file_;
  int descriptor_ = -1;
};

/// Whether FileBelow opens it. A link, a pipe or a device is reported on the console.
[[nodiscard]] bool is_below(const std::filesystem::path& folder, const std::filesystem::path& name);

}  // namespace cairn
