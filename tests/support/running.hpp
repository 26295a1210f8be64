// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Running program, for tests of signals.
#pragma once
#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "support/files.hpp"

namespace cairn {

/// Program started in a folder and killed by the destructor. Its stderr goes to a file, or to a pseudo-terminal read
/// here.
class Running {
 public:
  enum class Errors { to_file, to_terminal };
  Running(const std::vector<std::string>& arguments, const std::filesystem::path& folder,
          Errors errors = Errors::to_file);
  ~Running();
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  void send(int signal) const;
  /// Waits until `is_so` or the end of the program; fails the test after two minutes.
  [[nodiscard]] bool wait_until(const std::function<bool()>& is_so);
  /// True if the program handles SIGINT, as from the first line of main on.
  [[nodiscard]] bool handles_signals() const;
  /// Output to stderr so far.
  [[nodiscard]] std::string err();
  /// Waits for the end of the program; fails the test after two minutes.
  [[nodiscard]] Ran end();

 private:
  [[nodiscard]] bool has_ended();
  void read_terminal();
  TemporaryFolder files_;
  pid_t process_ = -1;
  int terminal_ = -1, status_ = 0;
  bool has_ended_ = false;
  std::string shown_;
};

/// File whose first reader, in a program started by Running, waits forever in its call of open.
class Blocking {
 public:
  explicit Blocking(const std::filesystem::path& file);
  ~Blocking();
  Blocking(const Blocking&) = delete;
  Blocking& operator=(const Blocking&) = delete;
  /// True if a reader waits.
  [[nodiscard]] bool holds_a_reader() const;

 private:
  TemporaryFolder folder_;
  std::filesystem::path mark_;
};

}  // namespace cairn
