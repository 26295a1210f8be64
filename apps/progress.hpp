// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <optional>
#include <string>

#include "cairn/export.hpp"

namespace cairn::apps {

/// Progress on stderr: one live line on a terminal, else a plain line every few seconds.
class Progress {
 public:
  explicit Progress(std::optional<int> total, std::string what = "frames");
  ~Progress();
  void step(const std::string& state);  // after each one; `state` in a few words
  void step(int done, int total, const std::string& state);
  void clear();  // before something else is printed

 private:
  using Clock = std::chrono::steady_clock;
  void show(const std::string& state);
  std::optional<int> total_;
  std::string what_;
  int done_ = 0;
  bool terminal_, shown_ = false;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

/// Tells an export's steps.
[[nodiscard]] inline ExportProgress on(Progress& progress) {
  return [&progress](int done, int total, const std::string& next) { progress.step(done, total, next); };
}

}  // namespace cairn::apps
