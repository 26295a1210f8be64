// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/system_file.hpp"

#include <sys/file.h>
#include <sys/stat.h>

#include <cstring>

namespace cairn {

std::string reason(int error) {
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

bool is_temporary(std::string_view name) {
  if (!name.starts_with(kTemporary)) return false;
  const std::size_t end = name.find_first_not_of("0123456789", kTemporary.size());
  return end != kTemporary.size() && end != name.npos && name[end] == '.';
}

std::filesystem::path temporary_beside(const std::filesystem::path& file, int number) {
  std::filesystem::path name = std::string(kTemporary) + std::to_string(getpid()) + ".";
  if (number > 0) name += std::to_string(number) + ".";
  name += file.filename();
  return file.parent_path() / name;
}

TemporaryFile make_temporary(const std::filesystem::path& file) {
  for (int number = 0;; ++number) {
    TemporaryFile made{.path = temporary_beside(file, number), .file = nullptr};
    try {
      made.file = std::make_unique<SystemFile>(made.path, O_RDWR | O_CREAT | O_EXCL);
    } catch (const SystemError& error) {
      if (error.number != EEXIST || number == kTemporaryNames) throw;
      continue;
    }
    // remove_leftovers of another process may have deleted the file before the lock was taken. On file systems without
    // locks no leftovers are removed.
    if (flock(made.file->descriptor(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) continue;
    struct stat now {};
    if (fstat(made.file->descriptor(), &now) != 0 || now.st_nlink > 0) return made;
  }
}

}  // namespace cairn
