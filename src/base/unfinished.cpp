// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/unfinished.hpp"

#include <unistd.h>

#include <map>
#include <mutex>
#include <system_error>
#include <utility>

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct Registry {
  std::mutex mutex;
  std::map<int, std::pair<fs::path, Unfinished::Kind>> all;  // keyed by number
  int last = 0;
};

/// Never destroyed, because a program may exit from any of its threads.
Registry& registry() {
  static auto* const all = new Registry;
  return *all;
}

/// Deletes a file or folder. A folder is renamed first, so that no thread adds files to it.
void remove(const fs::path& path, Unfinished::Kind kind) {
  std::error_code error;
  if (kind == Unfinished::Kind::empty) {
    (void)rmdir(path.c_str());
    return;
  }
  fs::path renamed = path;
  if (fs::is_directory(fs::symlink_status(path, error))) {
    renamed += ".removed-" + std::to_string(getpid());
    fs::rename(path, renamed, error);
    if (error) renamed = path;
  }
  fs::remove_all(renamed, error);
}

}  // namespace

Unfinished::Unfinished(fs::path path, Kind kind) {
  std::error_code error;
  fs::path absolute = fs::absolute(path, error);
  while (absolute.has_relative_path() && !absolute.has_filename()) absolute = absolute.parent_path();
  Registry& r = registry();
  const std::lock_guard lock(r.mutex);
  number_ = ++r.last;
  r.all.emplace(number_, std::pair(error ? std::move(path) : std::move(absolute), kind));
}

Unfinished::Unfinished(Unfinished&& other) noexcept : number_(std::exchange(other.number_, 0)) {}

Unfinished::~Unfinished() {
  if (number_ == 0) return;
  Registry& r = registry();
  const std::lock_guard lock(r.mutex);
  r.all.erase(number_);
}

void remove_unfinished() noexcept try {
  Registry& r = registry();
  r.mutex.lock();  // never unlocked: later registrations block until exit
  for (auto it = r.all.rbegin(); it != r.all.rend(); ++it) remove(it->second.first, it->second.second);
} catch (...) {
}

}  // namespace cairn
