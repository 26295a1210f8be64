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

/// The right to write into a session, which one process has at a time. The folder is made where it is missing, and goes
/// again when it is left empty.
class SessionLock {
 public:
  /// Throws std::runtime_error telling who has it and what to do.
  explicit SessionLock(std::filesystem::path session);
  ~SessionLock();
  SessionLock(const SessionLock&) = delete;
  SessionLock& operator=(const SessionLock&) = delete;

 private:
  std::filesystem::path session_;
  std::optional<FileLock> lock_;
};

}  // namespace cairn
