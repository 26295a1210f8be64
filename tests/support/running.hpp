// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The program while it runs, for tests that send it signals.
#pragma once
#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "support/files.hpp"

namespace cairn {

/// The program, started in a folder; it is killed with the object. What it prints to stderr is kept: to a file, or to a
/// terminal that this holds the other end of.
class Running {
 public:
  enum class Errors { to_file, to_terminal };
  Running(const std::vector<std::string>& arguments, const std::filesystem::path& folder,
          Errors errors = Errors::to_file);
  ~Running();
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  void send(int signal) const;
  /// Until `is_so`, or until the program ends; fails the test after two minutes.
  [[nodiscard]] bool wait_until(const std::function<bool()>& is_so);
  /// Whether it handles SIGINT: it does from the first line of main on.
  [[nodiscard]] bool handles_signals() const;
  /// What it has printed to stderr so far.
  [[nodiscard]] std::string err();
  /// Waits for its end; fails the test after two minutes.
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

/// A file whose first reader in a program started by Running waits forever in its call of open.
class Blocking {
 public:
  explicit Blocking(const std::filesystem::path& file);
  ~Blocking();
  Blocking(const Blocking&) = delete;
  Blocking& operator=(const Blocking&) = delete;
  /// Whether somebody waits.
  [[nodiscard]] bool holds_a_reader() const;

 private:
  TemporaryFolder folder_;
  std::filesystem::path mark_;
};

}  // namespace cairn
