// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <optional>
#include <utility>

namespace cairn {

/// Advisory lock (flock) on a file or folder, held for the lifetime of this object; released if the process is killed.
class FileLock {
 public:
  enum class Kind { shared, exclusive };
  /// Returns nullopt if another process holds the lock; `wait`: waits for it instead. Folders can be locked, too.
  [[nodiscard]] static std::optional<FileLock> take(const std::filesystem::path& file, Kind kind, bool wait = false);
  FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  ~FileLock();
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace cairn
