// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>

#include "cairn/reports.hpp"
#include "map/back_end.hpp"

namespace cairn {

/// Of a stage that its caller has ended.
inline constexpr const char* kEnded = "it was interrupted";

/// Consistency after the last frame: keyframes that see the same, by where they lie or by their looks, are aligned with
/// each other, by geometry alone, and the pose graph spreads what these alignments say against the tracked poses.
/// Throws std::runtime_error when `goes_on`, which is told the share that is done, says no; the poses stay as they are
/// then.
Refined refine(BackEnd& back_end, const std::function<bool(double)>& goes_on);

}  // namespace cairn
