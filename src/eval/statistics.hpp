// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "cairn/eval/evaluation.hpp"

namespace cairn {

inline ErrorStatistics statistics(std::vector<double> errors) {
  ErrorStatistics s{.count = static_cast<int>(errors.size())};
  if (errors.empty()) return s;
  for (const double e : errors) {
    s.mean += e;
    s.rmse += e * e;
    s.max = std::max(s.max, e);
  }
  s.mean /= s.count;
  s.rmse = std::sqrt(s.rmse / s.count);
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  s.median = *middle;
  const auto high = errors.begin() + (s.count * std::ptrdiff_t{95} + 99) / 100 - 1;  // nearest rank
  std::nth_element(errors.begin(), high, errors.end());
  s.p95 = *high;
  return s;
}

}  // namespace cairn
