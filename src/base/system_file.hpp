// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files as the system gives them, and what it says when it does not.
#pragma once
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <utility>

namespace cairn {

/// What went wrong, and what can be done about it.
[[nodiscard]] inline std::string reason(int error) {
  std::string text = std::strerror(error);
  switch (error) {
    case ENOSPC:
    case EDQUOT:
      return "the disk is full (" + text + "): make room there, or choose another";
    case ENOENT:
    case ENOTDIR:
      return text + ": make the folder first, or choose another";
    case EACCES:
    case EPERM:
    case EROFS:
      return text + ": choose a folder that you may write to";
    case EFBIG:
      return text + ": raise the limit on files, or choose another disk";
    case EIO:
      return text + ": the disk may be failing, choose another";
    default:
      return text;
  }
}

struct SystemError {
  int number;
};

class SystemFile {
 public:
  SystemFile(const std::filesystem::path& file, int flags) : descriptor_(open(file.c_str(), flags | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) throw SystemError{errno};
  }
  explicit SystemFile(int descriptor) : descriptor_(descriptor) {
    if (descriptor_ < 0) throw SystemError{errno};
  }
  ~SystemFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  SystemFile(SystemFile&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  SystemFile& operator=(SystemFile&&) = delete;
  [[nodiscard]] int descriptor() const { return descriptor_; }
  void write(const char* bytes, std::size_t count) const {
    while (count > 0) {
      const ssize_t written = ::write(descriptor_, bytes, count);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) throw SystemError{written == 0 ? ENOSPC : errno};
      bytes += written;
      count -= static_cast<std::size_t>(written);
    }
  }
  void sync() const {
    if (fsync(descriptor_) != 0) throw SystemError{errno};
  }
  void close() {
    if (::close(std::exchange(descriptor_, -1)) != 0) throw SystemError{errno};
  }

 private:
  int descriptor_;
};

}  // namespace cairn
