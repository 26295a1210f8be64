// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <utility>

namespace cairn::apps {
namespace {

constexpr double kTerminalInterval = 0.1, kPlainInterval = 5.0;  // seconds
constexpr int kBarWidth = 24;

}  // namespace

Progress::Progress(std::optional<int> total, std::string what)
    : total_(total), what_(std::move(what)), terminal_(isatty(STDERR_FILENO) != 0) {}
Progress::~Progress() { clear(); }

void Progress::clear() {
  if (shown_) fmt::print(stderr, "\r\x1b[K");
  shown_ = false;
}

void Progress::step(const std::string& state) {
  ++done_;
  show(state);
}

void Progress::step(int done, int total, const std::string& state) {
  done_ = done;
  total_ = total;
  show(state);
}

void Progress::show(const std::string& state) {
  const auto now = Clock::now();
  const bool last = total_ && done_ == *total_;
  if (!last && std::chrono::duration<double>(now - last_).count() < (terminal_ ? kTerminalInterval : kPlainInterval))
    return;
  last_ = now;
  const double rate = done_ / std::max(std::chrono::duration<double>(now - start_).count(), 1e-9);
  std::string line = fmt::format("{}{} {}  {:.1f}/s", done_, total_ ? fmt::format("/{}", *total_) : "", what_, rate);
  if (total_) {
    const int left = static_cast<int>(std::lround((*total_ - done_) / rate));
    line += fmt::format("  {}:{:02} left", left / 60, left % 60);
    if (terminal_) {
      const int filled = kBarWidth * done_ / std::max(*total_, 1);
      line = fmt::format("[{:█<{}}{:░<{}}] ", "", filled, "", kBarWidth - filled) + line;
    }
  }
  line += "  " + state;
  fmt::print(stderr, fmt::runtime(terminal_ ? "\r{}\x1b[K" : "{}\n"), line);
  std::fflush(stderr);
  shown_ = terminal_;
}

}  // namespace cairn::apps
