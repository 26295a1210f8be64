// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Disk errors, loaded into programs by LD_PRELOAD. Counts the operations on a folder:
// files opened for writing, writes, fsyncs, renames, folders made.
//   CAIRN_FAULTS_FOLDER  absolute; operations in this folder are counted
//   CAIRN_FAULTS_AT      failing operation, counted from 1; 0: none
//   CAIRN_FAULTS_KIND    full: this and all later writes fail (half of the first write fits); eio: only this operation
//                        fails; short: only this operation, if a write, writes half
//   CAIRN_FAULTS_LIMIT   maximum size of a file in bytes: as RLIMIT_FSIZE, except for the device's memory, which
//                        Mesa 25 keeps in anonymous files
//   CAIRN_FAULTS_EXCHANGE  no: the disk cannot exchange two folders
//   CAIRN_FAULTS_LOG     log file, a line for each operation
//   CAIRN_FAULTS_HOLD    a file whose first reader waits forever, as on an unresponsive disk
//   CAIRN_FAULTS_HELD    the file created by this reader
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

namespace {

template <class F>
F* next(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

std::string_view environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

std::array<std::atomic<bool>, 4096> watched;  // by descriptor
std::atomic<long> operations = 0;
std::atomic<bool> full = false;

bool is_inside(const char* path) {
  const std::string_view folder = environment("CAIRN_FAULTS_FOLDER");
  return !folder.empty() && path != nullptr && std::string_view(path).starts_with(folder);
}

void log(const char* what, const char* path) {
  static const int to = [] {
    const std::string file(environment("CAIRN_FAULTS_LOG"));
    using Open = int(const char*, int, ...);
    return file.empty() ? -1 : next<Open>("open")(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  }();
  if (to < 0) return;
  const std::string line = std::string(what) + " " + path + "\n";
  using Write = ssize_t(int, const void*, std::size_t);
  (void)!next<Write>("write")(to, line.data(), line.size());
}

enum class Fault { none, fails, half };

/// Result of the next operation; sets errno on failure.
Fault fault(const char* what, const char* path, bool writes) {
  static const long at = std::atol(std::string(environment("CAIRN_FAULTS_AT")).c_str());
  static const std::string kind(environment("CAIRN_FAULTS_KIND"));
  log(what, path);
  const long number = ++operations;
  if (full && writes) return errno = ENOSPC, Fault::fails;
  if (number != at) return Fault::none;
  const bool is_write = std::string_view(what) == "write";
  if (kind == "short") return is_write ? Fault::half : Fault::none;
  if (kind == "eio") return errno = EIO, Fault::fails;
  full = true;
  return is_write ? Fault::half : (errno = ENOSPC, Fault::fails);
}

Fault fault_of(const char* what, int descriptor, bool writes) {
  if (descriptor < 0 || descriptor >= static_cast<int>(watched.size()) ||
      !watched[static_cast<std::size_t>(descriptor)])
    return Fault::none;
  char path[4096] = "";
  const ssize_t size = readlink(("/proc/self/fd/" + std::to_string(descriptor)).c_str(), path, sizeof path - 1);
  path[size < 0 ? 0 : size] = 0;
  return fault(what, path, writes);
}

/// Number of bytes, at most `count`, that still fit into a file.
std::size_t room_for(int descriptor, std::size_t count) {
  static const long limit = std::atol(std::string(environment("CAIRN_FAULTS_LIMIT")).c_str());
  if (limit == 0 || descriptor < 0 || descriptor >= static_cast<int>(watched.size()) ||
      !watched[static_cast<std::size_t>(descriptor)])
    return count;
  const long at = lseek(descriptor, 0, SEEK_CUR);
  return at < 0 ? count : std::min(count, static_cast<std::size_t>(std::max(0L, limit - at)));
}

void watch(int descriptor, bool is_watched) {
  if (descriptor >= 0 && descriptor < static_cast<int>(watched.size()))
    watched[static_cast<std::size_t>(descriptor)] = is_watched;
}

/// Waits forever in the first thread of all programs that opens the held file.
void hold(const char* path) {
  const std::string held(environment("CAIRN_FAULTS_HOLD")), mark(environment("CAIRN_FAULTS_HELD"));
  struct stat file {
  }, opened{};
  if (held.empty() || path == nullptr || stat(held.c_str(), &file) != 0 || stat(path, &opened) != 0 ||
      file.st_dev != opened.st_dev || file.st_ino != opened.st_ino)
    return;
  using Open = int(const char*, int, ...);
  if (next<Open>("open")(mark.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666) < 0) return;
  while (true) pause();
}

int opened(const char* name, const char* path, int flags, mode_t mode) {
  const bool inside = is_inside(path), writes = (flags & O_ACCMODE) != O_RDONLY;
  if (!writes) hold(path);
  if (inside && writes && fault("open", path, (flags & O_CREAT) != 0) != Fault::none) return -1;
  using Open = int(const char*, int, ...);
  const int descriptor = next<Open>(name)(path, flags, mode);
  watch(descriptor, inside && (writes || (flags & O_DIRECTORY) != 0));
  return descriptor;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  std::va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return opened("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  std::va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return opened("open64", path, flags, mode);
}

std::FILE* fopen(const char* path, const char* mode) {
  if (std::strpbrk(mode, "wa+") == nullptr) hold(path);
  const bool inside = is_inside(path) && std::strpbrk(mode, "wa+") != nullptr;
  if (inside && fault("open", path, true) != Fault::none) return nullptr;
  std::FILE* file = next<std::FILE*(const char*, const char*)>("fopen")(path, mode);
  if (file != nullptr) watch(fileno(file), inside);
  return file;
}
std::FILE* fopen64(const char* path, const char* mode) { return fopen(path, mode); }

ssize_t write(int descriptor, const void* bytes, std::size_t count) {
  const Fault f = fault_of("write", descriptor, true);
  if (f == Fault::fails) return -1;
  const std::size_t room = room_for(descriptor, f == Fault::half ? (count + 1) / 2 : count);
  if (room == 0 && count > 0) return errno = EFBIG, -1;
  return next<ssize_t(int, const void*, std::size_t)>("write")(descriptor, bytes, room);
}

ssize_t writev(int descriptor, const struct iovec* parts, int count) {
  const Fault f = fault_of("write", descriptor, true);
  if (f == Fault::fails) return -1;
  std::size_t bytes = 0;
  for (int i = 0; i < count; ++i) bytes += parts[i].iov_len;
  if (const std::size_t room = room_for(descriptor, bytes); room < bytes) {  // the first non-empty part
    while (parts->iov_len == 0) ++parts;
    if (room == 0) return errno = EFBIG, -1;
    using Write = ssize_t(int, const void*, std::size_t);
    return next<Write>("write")(descriptor, parts->iov_base, std::min(room, parts->iov_len));
  }
  return next<ssize_t(int, const struct iovec*, int)>("writev")(descriptor, parts,
                                                                f == Fault::half ? (count + 1) / 2 : count);
}

int fsync(int descriptor) {
  return fault_of("fsync", descriptor, false) == Fault::none ? next<int(int)>("fsync")(descriptor) : -1;
}

int syncfs(int descriptor) {
  return fault_of("syncfs", descriptor, false) == Fault::none ? next<int(int)>("syncfs")(descriptor) : -1;
}

int rename(const char* from, const char* to) {
  if (is_inside(to) && fault("rename", to, false) != Fault::none) return -1;
  return next<int(const char*, const char*)>("rename")(from, to);
}

/// CAIRN_FAULTS_EXCHANGE=no: as on a disk without support for rename flags.
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  if (is_inside(to) && flags != 0 && environment("CAIRN_FAULTS_EXCHANGE") == "no") return errno = EINVAL, -1;
  if (is_inside(to) && fault("rename", to, false) != Fault::none) return -1;
  using Rename = int(int, const char*, int, const char*, unsigned);
  return next<Rename>("renameat2")(from_folder, from, to_folder, to, flags);
}

int mkdir(const char* path, mode_t mode) {
  if (is_inside(path) && fault("mkdir", path, true) != Fault::none) return -1;
  return next<int(const char*, mode_t)>("mkdir")(path, mode);
}

int unlink(const char* path) {
  if (is_inside(path)) log("unlink", path);
  return next<int(const char*)>("unlink")(path);
}

int remove(const char* path) {
  if (is_inside(path)) log("unlink", path);
  return next<int(const char*)>("remove")(path);
}

int close(int descriptor) {
  watch(descriptor, false);
  return next<int(int)>("close")(descriptor);
}

}  // extern "C"
