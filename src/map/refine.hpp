// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/reports.hpp"
#include "map/back_end.hpp"

namespace cairn {

/// Consistency after the last frame: keyframes that see the same, by where they lie or by their looks, are aligned with
/// each other, by geometry alone, and the pose graph spreads what these alignments say against the tracked poses.
Refined refine(BackEnd& back_end);

}  // namespace cairn
