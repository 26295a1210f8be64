// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <optional>
#include <utility>

namespace cairn {

/// A lock of the system on a file or folder (flock), held as long as this lives; a killed process holds none.
class FileLock {
 public:
  enum class Kind { shared, exclusive };
  /// Nothing where somebody else holds it; `patient`: waits for the other. A folder may be locked as it is.
  [[nodiscard]] static std::optional<FileLock> take(const std::filesystem::path& file, Kind kind, bool patient = false);
  FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  ~FileLock();
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace cairn
