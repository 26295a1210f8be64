// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <utility>

namespace cairn::apps {
namespace {

constexpr double kLiveInterval = 0.1, kPlainInterval = 5.0;                             // seconds
constexpr int kBarWidth = 24, kMinBarWidth = 8, kBracketWidth = 3, kMinStateWidth = 8;  // columns

std::string bar(double share, int columns, bool has_blocks) {
  const int filled = std::clamp(static_cast<int>(share * columns), 0, columns);
  std::string bar = "[";
  for (int i = 0; i < columns; ++i) bar += has_blocks ? (i < filled ? "█" : "░") : (i < filled ? "#" : ".");
  return bar + "] ";
}

}  // namespace

std::string progress_line(const ProgressState& done, const std::string& state, const Terminal& terminal) {
  const int max_columns =
      terminal.is_live ? terminal.columns - 1 : 1 << 20;  // most terminals wrap after the last column
  const double share = done.total ? std::min(1.0, done.done / std::max(1.0, static_cast<double>(*done.total))) : 0;
  const double rate = done.done / std::max(done.seconds, 1e-9);
  std::string line = done.what.empty() && done.total ? fmt::format("{:.0f} %", 100 * share)
                     : done.total                    ? fmt::format("{}/{} {}", done.done, *done.total, done.what)
                                                     : fmt::format("{} {}", done.done, done.what);
  const auto add = [&](const std::string& more) {
    if (width_of(line) + 2 + width_of(more) <= max_columns) line += "  " + more;
  };
  if (!done.what.empty()) add(fmt::format("{:.1f}/s", rate));
  if (done.total && done.done > 0) {
    const int left = static_cast<int>(std::lround((*done.total * (1 + done.following) - done.done) / rate));
    add(fmt::format("{}:{:02} left", left / 60, left % 60));
  }
  // The bar's size is independent of the text beside it.
  const int left = max_columns - width_of(line), columns = std::min(kBarWidth, left / 3);
  const bool has_bar = terminal.is_live && done.total && columns >= kMinBarWidth;
  const int state_columns = left - 2 - (has_bar ? columns + kBracketWidth : 0);
  if (!state.empty() && state_columns >= kMinStateWidth)
    line += "  " + cut_to(state, state_columns, terminal.has_blocks);
  if (has_bar) line = bar(share, columns, terminal.has_blocks) + line;
  return terminal.is_live ? cut_to(line, max_columns, terminal.has_blocks) : line;
}

Progress::Progress(std::optional<int> total, std::string what, double following)
    : state_{.total = total, .what = std::move(what), .following = following} {}
Progress::~Progress() { clear(); }

void Progress::clear() { clear_line(); }

void Progress::step(const std::string& state) {
  ++state_.done;
  show(state);
}

void Progress::step(int done, int total, const std::string& state) {
  // Restarted work, such as a mesh repeated without its texture, does not move the bar back.
  if (!state_.total || done * std::int64_t{*state_.total} > state_.done * std::int64_t{total}) {
    state_.done = done;
    state_.total = total;
  }
  show(state);
}

void Progress::show(const std::string& state) {
  if (is_quiet()) return;
  const auto now = Clock::now();
  const Terminal terminal = terminal_of(STDERR_FILENO);
  const bool is_last = state_.total && state_.done == *state_.total;
  const bool is_first = terminal.is_live && last_ == start_;  // a stage shows its name at once
  if (!is_first && !is_last &&
      std::chrono::duration<double>(now - last_).count() < (terminal.is_live ? kLiveInterval : kPlainInterval))
    return;
  last_ = now;
  state_.seconds = std::chrono::duration<double>(now - start_).count();
  const std::string line = progress_line(state_, state, terminal);
  if (terminal.is_live)
    show_line(line);
  else
    fmt::print(stderr, "{}\n", line);
}

}  // namespace cairn::apps
