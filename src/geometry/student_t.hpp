// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Heavy-tailed error model of tracking: mostly small errors, sometimes very large ones when tracking slips. Student's
// t-distribution in six dimensions (Lange, Little & Taylor 1989).
#pragma once
#include <cmath>

namespace cairn {

inline constexpr double kStepFreedom = 5;

/// Weight of an edge with this squared error in units of its noise.
[[nodiscard]] inline double weight_of_step(double squared_error) {
  return (kStepFreedom + 6) / (kStepFreedom + squared_error);
}
/// Twice the cost of such an edge.
[[nodiscard]] inline double cost_of_step(double squared_error) {
  return (kStepFreedom + 6) * std::log(1 + squared_error / kStepFreedom);
}

}  // namespace cairn
