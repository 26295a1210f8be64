// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <vector>

#include "cairn/io/inspect.hpp"

namespace cairn {

/// Samples of the inertial sensors of a recording's first frames.
struct InertialRecord {
  std::vector<AngularRate> rates;
  std::vector<Acceleration> accelerations;

  void add(const Frame& frame);
};

/// Rates, norm and gaps.
[[nodiscard]] InertialSummary summarize(const InertialRecord& record);
/// Implausible values, one line each: unit, resting or saturated axes, gaps, low rates, different times.
[[nodiscard]] std::vector<std::string> find_doubts(const InertialRecord& record, const InertialSummary& summary);

}  // namespace cairn
