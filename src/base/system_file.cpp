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

std::filesystem::path temporary_beside(const std::filesystem::path& file) {
  std::filesystem::path name = std::string(kTemporary) + std::to_string(getpid()) + ".";
  name += file.filename();
  return file.parent_path() / name;
}

std::unique_ptr<SystemFile> begin_temporary(const std::filesystem::path& temporary) {
  while (true) {
    auto file = std::make_unique<SystemFile>(temporary, O_RDWR | O_CREAT | O_TRUNC);
    (void)flock(file->descriptor(), LOCK_EX | LOCK_NB);  // where there are no locks, nothing is taken for left over
    struct stat now {};
    if (fstat(file->descriptor(), &now) != 0 || now.st_nlink > 0) return file;
  }
}

}  // namespace cairn
