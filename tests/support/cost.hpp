// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Time and memory of a call in a child process; a crash there fails only one test.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace cairn {

struct Cost {
  double seconds = 0;
  double peak_mb = 0;  // resident; for cost_of including the test process' own
  bool ended = false;  // normally, with exit code 0 or 1
  std::string error;   // message of the call's exception
};

/// Cost of a call. Ended by SIGKILL after `max_seconds`.
[[nodiscard]] Cost cost_of(const std::function<void()>& call, int max_seconds = 20);

/// Cost of a run of the program; `error` is its stderr.
[[nodiscard]] Cost cost_of_cairn(const std::vector<std::string>& arguments, int max_seconds = 60);

}  // namespace cairn
