// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Time and memory that a call takes, in a process of its own: what crashes there fails one test.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace cairn {

struct Cost {
  double seconds = 0;
  double peak_mb = 0;  // resident; of cost_of with what the test's process had
  bool ended = false;  // by itself, with exit code 0 or 1
  std::string error;   // what the call threw
};

/// Of a call. Ended by SIGKILL after `most_seconds`.
[[nodiscard]] Cost cost_of(const std::function<void()>& call, int most_seconds = 20);

/// Of a run of the program; `error` is what it printed to stderr.
[[nodiscard]] Cost cost_of_cairn(const std::vector<std::string>& arguments, int most_seconds = 60);

}  // namespace cairn
