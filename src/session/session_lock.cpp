// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/session_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLock = "lock";                // in the session's folder
constexpr auto kPatience = std::chrono::seconds(3);  // a killed process takes a moment to go
constexpr std::size_t kLongest = 200;                // characters of a command line

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// For whoever finds the session taken.
std::string who_i_am() {
  std::string command = text_of("/proc/self/cmdline");
  while (!command.empty() && command.back() == '\0') command.pop_back();
  for (char& c : command)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  if (command.size() > kLongest) command.replace(kLongest, command.npos, "...");
  return fmt::format("process {}: {}", getpid(), command);
}

bool is_the_file_at(int descriptor, const fs::path& file) {
  struct stat held {
  }, there{};
  return fstat(descriptor, &held) == 0 && stat(file.c_str(), &there) == 0 && held.st_ino == there.st_ino &&
         held.st_dev == there.st_dev;
}

}  // namespace

std::optional<FileLock> FileLock::take(const fs::path& file, Kind kind, bool patient) {
  const bool makes = kind == Kind::exclusive && !fs::is_directory(file);
  const int descriptor = open(file.c_str(), (makes ? O_RDWR | O_CREAT : O_RDONLY) | O_CLOEXEC, 0666);
  if (descriptor < 0) throw std::runtime_error("cannot lock " + file.string() + ": " + std::strerror(errno));
  FileLock lock(descriptor);
  int result = 0;
  do result = flock(descriptor, (kind == Kind::shared ? LOCK_SH : LOCK_EX) | (patient ? 0 : LOCK_NB));
  while (result != 0 && errno == EINTR);
  if (result == 0) return lock;
  if (errno == EWOULDBLOCK) return std::nullopt;
  if (kind == Kind::shared) return lock;  // there are no locks here, and reading does no harm
  throw std::runtime_error("cannot lock " + file.string() + ": " + std::strerror(errno) +
                           "; choose a folder on another disk");
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

SessionLock::SessionLock(fs::path session) : session_(std::move(session)) {
  using Clock = std::chrono::steady_clock;
  const fs::path file = session_ / kLock;
  const auto end = Clock::now() + kPatience;
  std::error_code error;
  try {
    // One who ends takes the file away, see below: then the lock is on nothing, and the next try makes a new file.
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
    } while (!lock_ || !is_the_file_at(lock_->descriptor(), file));
  } catch (...) {
    fs::remove(session_, error);  // unless there is something in it
    throw;
  }
  if (!lock_) {
    const std::string who = text_of(file);
    throw std::runtime_error(session_.string() + ": another run writes into it (" +
                             (who.empty() ? "which has just begun" : who) +
                             "); wait for its end, or choose another folder with -o");
  }
  const std::string who = who_i_am();
  if (ftruncate(lock_->descriptor(), 0) == 0)
    (void)!write(lock_->descriptor(), who.data(), who.size());  // on a full disk nobody is told who it is
}

SessionLock::~SessionLock() {
  std::error_code ignored;
  fs::remove(session_ / kLock, ignored);
  fs::remove(session_, ignored);  // unless there is something in it
}

}  // namespace cairn
