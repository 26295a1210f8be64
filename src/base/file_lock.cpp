// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/file_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace cairn {

namespace fs = std::filesystem;

std::optional<FileLock> FileLock::take(const fs::path& file, Kind kind, bool wait) {
  const bool creates = kind == Kind::exclusive && !fs::is_directory(file);
  const int descriptor = open(file.c_str(), (creates ? O_RDWR | O_CREAT : O_RDONLY) | O_CLOEXEC, 0666);
  if (descriptor < 0) throw std::runtime_error("cannot lock " + file.string() + ": " + std::strerror(errno));
  FileLock lock(descriptor);
  int result = 0;
  do result = flock(descriptor, (kind == Kind::shared ? LOCK_SH : LOCK_EX) | (wait ? 0 : LOCK_NB));
  while (result != 0 && errno == EINTR);
  if (result == 0) return lock;
  if (errno == EWOULDBLOCK) return std::nullopt;
  if (kind == Kind::shared) return lock;  // file system without locks; reading is harmless
  throw std::runtime_error("cannot lock " + file.string() + ": " + std::strerror(errno) +
                           "; choose a folder on another disk");
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace cairn
