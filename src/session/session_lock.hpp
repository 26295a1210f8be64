// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <optional>

#include "base/file_lock.hpp"

namespace cairn {

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
