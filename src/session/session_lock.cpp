// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/session_lock.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLock = "lock";                  // in the session's folder
constexpr std::string_view kOwnerPrefix = "process ";  // prefix of the lock file's text
constexpr auto kTimeout = std::chrono::seconds(3);     // a killed process takes a moment to exit
constexpr std::size_t kMaxCommandLength = 200;         // characters of a command line

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Text for other processes that find the session locked.
std::string owner_text() {
  std::string command = text_of("/proc/self/cmdline");
  while (!command.empty() && command.back() == '\0') command.pop_back();
  for (char& c : command)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  if (command.size() > kMaxCommandLength) command.replace(kMaxCommandLength, command.npos, "...");
  return fmt::format("{}{}: {}", kOwnerPrefix, getpid(), command);
}

bool is_same_file(int descriptor, const fs::path& file) {
  struct stat locked {
  }, on_disk{};
  return fstat(descriptor, &locked) == 0 && stat(file.c_str(), &on_disk) == 0 && locked.st_ino == on_disk.st_ino &&
         locked.st_dev == on_disk.st_dev;
}

}  // namespace

SessionLock::SessionLock(fs::path session) : session_(std::move(session)) {
  using Clock = std::chrono::steady_clock;
  const fs::path file = session_ / kLock;
  const auto end = Clock::now() + kTimeout;
  std::error_code error;
  try {
    // A process that exits removes the file, see below. Its lock is then void, and the next attempt makes a new file.
    do {
      fs::create_directories(session_, error);
      if (error)
        throw std::runtime_error("cannot make the folder " + session_.string() + ": " + error.message() +
                                 "; choose another with -o");
      lock_.reset();
      if (auto lock = FileLock::take(file, FileLock::Kind::exclusive))
        lock_.emplace(std::move(*lock));
      else if (Clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      else
        break;
    } while (!lock_ || !is_same_file(lock_->descriptor(), file));
  } catch (...) {
    fs::remove(session_, error);  // fails if the folder is not empty
    throw;
  }
  if (!lock_) {
    const std::string owner = text_of(file);
    throw std::runtime_error(session_.string() + ": another run writes into it (" +
                             (owner.empty() ? "just started" : owner) +
                             "); wait for its end, or choose another folder with -o");
  }
  if (const std::string before = text_of(file); !before.empty() && !before.starts_with(kOwnerPrefix)) {
    lock_.reset();
    throw std::runtime_error(file.string() +
                             ": is not the lock file of a session; choose another "
                             "folder with -o");
  }
  const std::string owner = owner_text();
  if (ftruncate(lock_->descriptor(), 0) == 0)
    (void)!write(lock_->descriptor(), owner.data(), owner.size());  // on a full disk the owner stays unnamed
}

SessionLock::~SessionLock() {
  std::error_code ignored;
  fs::remove(session_ / kLock, ignored);
  fs::remove(session_, ignored);  // fails if the folder is not empty
}

}  // namespace cairn
