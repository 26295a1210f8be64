// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>

#include "cairn/mapping/reports.hpp"
#include "mapper/back_end.hpp"

namespace cairn {

/// Error message of an interrupted stage.
inline constexpr const char* kInterrupted = "interrupted";

/// Global consistency after the last frame: aligns pairs of keyframes with nearby poses or matching features, by
/// geometry alone, and optimizes the pose graph with these alignments and odometry. `progress` receives the completed
/// share; on false, throws std::runtime_error and leaves the poses unchanged.
RefineReport refine(BackEnd& back_end, const std::function<bool(double)>& progress);

}  // namespace cairn
