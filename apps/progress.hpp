// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <optional>
#include <string>

namespace cairn::apps {

/// Progress on stderr: one live line on a terminal, else a plain line every few seconds.
class Progress {
 public:
  explicit Progress(std::optional<int> total);
  ~Progress();
  void step(const std::string& state);  // after each frame; `state` in a few words
  void clear();                         // before something else is printed

 private:
  using Clock = std::chrono::steady_clock;
  std::optional<int> total_;
  int done_ = 0;
  bool terminal_, shown_ = false;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

}  // namespace cairn::apps
