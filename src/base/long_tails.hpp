// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Steps of tracking mostly err by little and sometimes, where it slips, by very much: as a t-distribution of six
// dimensions does (Lange, Little & Taylor 1989).
#pragma once
#include <cmath>

namespace cairn {

inline constexpr double kStepFreedom = 5;

/// By its squared error in units of its noise.
[[nodiscard]] inline double weight_of_step(double squared_error) {
  return (kStepFreedom + 6) / (kStepFreedom + squared_error);
}
/// Twice what that adds to a cost.
[[nodiscard]] inline double cost_of_step(double squared_error) {
  return (kStepFreedom + 6) * std::log(1 + squared_error / kStepFreedom);
}

}  // namespace cairn
