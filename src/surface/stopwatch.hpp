// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <map>
#include <string>

namespace cairn {

/// Milliseconds by stage.
using StageTimes = std::map<std::string, double>;

/// Runs a stage and adds its time.
template <class Stage>
auto timed(StageTimes& times, const char* name, Stage&& stage) {
  const auto start = std::chrono::steady_clock::now();
  auto result = stage();
  times[name] += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace cairn
