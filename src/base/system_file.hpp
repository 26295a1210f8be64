// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files by system calls, with error messages.
#pragma once
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cairn {

/// Text for an errno value, with the remedy.
[[nodiscard]] std::string reason(int error);

struct SystemError {
  int number;
};

class SystemFile {
 public:
  SystemFile(const std::filesystem::path& file, int flags) : descriptor_(open(file.c_str(), flags | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) throw SystemError{errno};
  }
  ~SystemFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  SystemFile(const SystemFile&) = delete;
  SystemFile& operator=(const SystemFile&) = delete;
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

constexpr std::string_view kTemporary = ".cairn-";  // prefix of temporary file names

/// True for a name of the form of a temporary file or folder: `.cairn-PID.NAME`.
[[nodiscard]] bool is_temporary(std::string_view name);

constexpr int kTemporaryNames = 1000;  // maximum attempts per file

/// The number-th name for a temporary file or folder beside `file`: `.cairn-PID.NAME`, `.cairn-PID.1.NAME`, and so on.
/// The extension stays last, because it identifies the file format.
[[nodiscard]] std::filesystem::path temporary_beside(const std::filesystem::path& file, int number);

struct TemporaryFile {
  std::filesystem::path path;
  std::unique_ptr<SystemFile> file;
};
/// Creates a temporary file beside `file` under an unused name. Its lock marks the writer as alive, see
/// remove_leftovers. Throws SystemError.
[[nodiscard]] TemporaryFile make_temporary(const std::filesystem::path& file);

}  // namespace cairn
