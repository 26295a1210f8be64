// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <optional>

#include "base/file_lock.hpp"

namespace cairn {

/// Exclusive lock for writing a session, for one process at a time. Makes a missing folder, and removes it again if it
/// stays empty.
class SessionLock {
 public:
  /// Throws std::runtime_error with the owner of the lock and the remedy.
  explicit SessionLock(std::filesystem::path session);
  ~SessionLock();
  SessionLock(const SessionLock&) = delete;
  SessionLock& operator=(const SessionLock&) = delete;

 private:
  std::filesystem::path session_;
  std::optional<FileLock> lock_;
};

}  // namespace cairn
