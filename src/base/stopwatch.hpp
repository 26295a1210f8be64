// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Timing of stages.
#pragma once
#include <chrono>
#include <map>
#include <string>

namespace cairn {

/// Milliseconds per stage.
using StageTimes = std::map<std::string, double>;

/// Runs a stage and adds its duration.
template <class Stage>
auto timed(StageTimes& times, const char* name, Stage&& stage) {
  struct Stopwatch {
    double& total;
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
    ~Stopwatch() {
      total += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    }
  } stopwatch{times[name]};
  return stage();
}

}  // namespace cairn
