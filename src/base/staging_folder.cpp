// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/staging_folder.hpp"

#include <sys/file.h>
#include <sys/stat.h>

#include <array>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <string_view>

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Names beside the content, never used by the content itself because of their temporary prefix.
constexpr const char *kMarker = ".cairn-mark", *kAside = ".cairn-aside";
constexpr std::string_view kMarkerText = "A folder that cairn makes for what it writes, and removes.\n";

int rename_to(const fs::path& from, const fs::path& to) {
  return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

bool is_full(int error) { return error == ENOTEMPTY || error == EEXIST; }

/// Makes the new content durable before the old content is removed, for a power failure.
void sync_disk_of(const fs::path& folder) {
  const SystemFile open(folder, O_RDONLY | O_DIRECTORY);
  if (syncfs(open.descriptor()) != 0) throw SystemError{errno};
}

/// Content folder inside a staging folder; empty if it has been moved to its destination.
fs::path content_of(const fs::path& staging) {
  for (const auto& entry : fs::directory_iterator(staging))
    if (const fs::path name = entry.path().filename(); name != kMarker && name != kAside) return entry.path();
  return {};
}

}  // namespace

StagingFolder::StagingFolder(const fs::path& destination) {
  for (int number = 0;; ++number) {
    folder_ = temporary_beside(destination, number);
    if (mkdir(folder_.c_str(), 0777) == 0) break;
    if (errno != EEXIST || number == kTemporaryNames) throw SystemError{errno};
  }
  unfinished_.emplace(folder_);
  content_ = folder_ / destination.filename();
  try {
    mark_ = std::make_unique<SystemFile>(folder_ / kMarker, O_RDWR | O_CREAT | O_EXCL);
    (void)flock(mark_->descriptor(), LOCK_EX | LOCK_NB);  // without locks on the file system, no staging folder counts
                                                          // as left over
    mark_->write(kMarkerText.data(), kMarkerText.size());
    if (mkdir(content_.c_str(), 0777) != 0) throw SystemError{errno};
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
    throw;
  }
}

StagingFolder::~StagingFolder() {
  std::error_code ignored;
  if (is_removed_) fs::remove_all(folder_, ignored);
}

void StagingFolder::replace_folder(const fs::path& destination) {
  int error = rename_to(content_, destination);  // also replaces an empty folder
  if (error == 0) return;
  if (!is_full(error)) throw SystemError{error};
  sync_disk_of(content_);
  if (renameat2(AT_FDCWD, content_.c_str(), AT_FDCWD, destination.c_str(), RENAME_EXCHANGE) == 0) return;
  if (errno != ENOSYS && errno != EINVAL && errno != ENOTSUP) throw SystemError{errno};
  unfinished_.reset();  // from here on it contains old content not yet replaced
  const fs::path aside = folder_ / kAside;
  if ((error = rename_to(destination, aside)) != 0) throw SystemError{error};
  if ((error = rename_to(content_, destination)) == 0) return;
  if (rename_to(aside, destination) == 0) throw SystemError{error};
  is_removed_ = false;
  throw std::runtime_error("cannot write " + destination.string() + ": " + reason(error) + "; the old content is in " +
                           aside.string());
}

void remove_left_staging(const fs::path& folder) {
  try {
    const SystemFile mark(folder / kMarker, O_RDWR | O_NOFOLLOW);
    if (flock(mark.descriptor(), LOCK_EX | LOCK_NB) != 0) return;
    std::array<char, kMarkerText.size() + 1> text{};
    const ssize_t size = read(mark.descriptor(), text.data(), text.size());
    if (size < 0 || std::string_view(text.data(), static_cast<std::size_t>(size)) != kMarkerText) return;
    std::error_code ignored;
    const fs::path aside = folder / kAside;
    if (const fs::path content = content_of(folder); fs::exists(aside) && !content.empty()) {
      // Killed between two renames: the destination is empty.
      const fs::path destination = folder.parent_path() / content.filename();
      if (fs::exists(fs::symlink_status(destination)) || rename_to(aside, destination) != 0) return;
    }
    fs::remove_all(folder, ignored);
  } catch (const SystemError&) {
    // Without a mark, or of another user: keep it.
  } catch (const fs::filesystem_error&) {
  }
}

}  // namespace cairn
