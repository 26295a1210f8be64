// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/file_below.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace cairn {
namespace {

namespace fs = std::filesystem;

std::runtime_error not_shown(const fs::path& file, const std::string& why) {
  return std::runtime_error(file.string() + ": is not shown: " + why);
}

std::string reason_of(int error) {
  if (error == ELOOP) return "it is a link; put the file itself there";
  return std::strerror(error);
}

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  void reset(int number) {
    if (number_ >= 0) close(number_);
    number_ = number;
  }
  [[nodiscard]] int number() const { return number_; }

 private:
  int number_;
};

/// openat() of one path component, which must not be a link. The system reports a link to a folder as ENOTDIR; this
/// function reports ELOOP.
int open_component(int folder, const fs::path& name, int flags) {
  const int descriptor = openat(folder, name.c_str(), flags | O_NOFOLLOW | O_CLOEXEC);
  const int error = errno;
  struct stat status {};
  if (descriptor < 0 && fstatat(folder, name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0 && S_ISLNK(status.st_mode))
    errno = ELOOP;
  else
    errno = error;
  return descriptor;
}

/// Checks the file type before and after opening, since opening a device may have side effects.
int open_regular(int folder, const fs::path& name) {
  struct stat status {};
  if (fstatat(folder, name.c_str(), &status, AT_SYMLINK_NOFOLLOW) != 0) return -1;
  if (!S_ISREG(status.st_mode)) {
    errno = S_ISLNK(status.st_mode) ? ELOOP : S_ISDIR(status.st_mode) ? EISDIR : ENXIO;
    return -1;
  }
  const int descriptor = open_component(folder, name, O_RDONLY | O_NONBLOCK | O_NOCTTY);
  if (descriptor >= 0 && (fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode))) {
    close(descriptor);
    errno = ENXIO;
    return -1;
  }
  return descriptor;
}

/// Returns the descriptor, or -1 with errno.
int open_below(const fs::path& folder, const fs::path& name) {
  errno = EXDEV;
  if (name.empty() || name.is_absolute() || name.native().find('\0') != name.native().npos) return -1;
  Descriptor at(open(folder.empty() ? "." : folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (at.number() < 0) return -1;
  for (const fs::path& component : name.parent_path()) {
    errno = EXDEV;
    if (component == "..") return -1;
    if (component.empty() || component == ".") continue;
    const int next = open_component(at.number(), component, O_PATH | O_DIRECTORY);
    if (next < 0) return -1;
    at.reset(next);
  }
  errno = EXDEV;
  if (name.filename() == ".." || name.filename() == "." || name.filename().empty()) return -1;
  return open_regular(at.number(), name.filename());
}

}  // namespace

FileBelow::FileBelow(const fs::path& folder, const fs::path& name)
    : file_(folder / name), descriptor_(open_below(folder, name)) {
  if (descriptor_ >= 0) return;
  const int error = errno;
  if (error == EXDEV) throw not_shown(file_, "it is outside of " + folder.string());
  if (error == ENXIO) throw not_shown(file_, "it is a pipe or a device; put a file there");
  throw not_shown(file_, reason_of(error));
}

FileBelow::~FileBelow() {
  if (descriptor_ >= 0) close(descriptor_);
}

std::string FileBelow::read(std::size_t max_bytes) const {
  struct stat status {};
  if (fstat(descriptor_, &status) != 0) throw not_shown(file_, reason_of(errno));
  if (static_cast<std::size_t>(status.st_size) > max_bytes)
    throw not_shown(file_, fmt::format("it has {} bytes, more than {}", status.st_size, max_bytes));
  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = pread(descriptor_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw not_shown(file_, reason_of(errno));
    if (count == 0) break;  // the file was truncated meanwhile
    done += static_cast<std::size_t>(count);
  }
  bytes.resize(done);
  return bytes;
}

bool is_below(const fs::path& folder, const fs::path& name) {
  std::error_code ignored;
  if (fs::symlink_status(folder / name, ignored).type() == fs::file_type::not_found) return false;
  try {
    const FileBelow file(folder, name);
    return true;
  } catch (const std::runtime_error& error) {
    spdlog::warn(fmt::format("view: {}", error.what()));
    return false;
  }
}

}  // namespace cairn
