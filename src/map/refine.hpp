// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>

#include "cairn/reports.hpp"
#include "map/back_end.hpp"

namespace cairn {

/// Error message of an interrupted stage.
inline constexpr const char* kEnded = "it was interrupted";

/// Global consistency after the last frame: aligns pairs of keyframes with nearby poses or matching features, by
/// geometry alone, and optimizes the pose graph with these alignments and odometry. `goes_on` receives the completed
/// share; on false, throws std::runtime_error and leaves the poses unchanged.
Refined refine(BackEnd& back_end, const std::function<bool(double)>& goes_on);

}  // namespace cairn
