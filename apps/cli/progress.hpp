// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <optional>
#include <string>

#include "cairn/mapping/export.hpp"
#include "cli/console.hpp"

namespace cairn::apps {

/// State of a progress line.
struct ProgressState {
  int done = 0;
  std::optional<int> total;
  std::string what;      // unit of the count; empty: only the percentage is shown
  double seconds = 0;    // elapsed time
  double following = 0;  // estimated time of the work that follows, relative to the time of these steps
};
/// Formats progress in one line of at most `terminal.columns`, with a bar on a live terminal. Drops text that does not
/// fit; the count has priority.
[[nodiscard]] std::string progress_line(const ProgressState& done, const std::string& state, const Terminal& terminal);

/// Progress on stderr: a live line on a terminal, else a plain line every few seconds; silent with --quiet.
class Progress {
 public:
  /// `following`: see ProgressState.
  explicit Progress(std::optional<int> total, std::string what = "frames", double following = 0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void step(const std::string& state);  // after each step; `state` is a short text
  void step(int done, int total, const std::string& state);
  void clear();  // before other output

 private:
  using Clock = std::chrono::steady_clock;
  void show(const std::string& state);
  ProgressState state_;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

/// Shows the steps of an export.
[[nodiscard]] inline ExportProgress export_progress(Progress& progress) {
  return [&progress](int done, int total, const std::string& next) { progress.step(done, total, next); };
}

}  // namespace cairn::apps
