// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <optional>
#include <string>

#include "cairn/export.hpp"
#include "console.hpp"

namespace cairn::apps {

/// How far something is.
struct Done {
  int done = 0;
  std::optional<int> total;
  std::string what;    // is counted; empty: only the share is told
  double seconds = 0;  // since it began
};
/// In one line of at most so many columns, with a bar where it is a live terminal: what does not fit is left out, what
/// is counted comes first.
[[nodiscard]] std::string progress_line(const Done& done, const std::string& state, const Terminal& terminal);

/// Progress on stderr: one live line on a terminal, else a plain line every few seconds; nothing with --quiet.
class Progress {
 public:
  explicit Progress(std::optional<int> total, std::string what = "frames");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void step(const std::string& state);  // after each one; `state` in a few words
  void step(int done, int total, const std::string& state);
  void clear();  // before something else is printed

 private:
  using Clock = std::chrono::steady_clock;
  void show(const std::string& state);
  Done done_;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

/// Tells an export's steps.
[[nodiscard]] inline ExportProgress on(Progress& progress) {
  return [&progress](int done, int total, const std::string& next) { progress.step(done, total, next); };
}

}  // namespace cairn::apps
