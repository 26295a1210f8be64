// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/reports.hpp"
#include "map/back_end.hpp"

namespace cairn {

/// Moves the keyframes of the main piece to where all that they see agrees best. `clock_offset`: of the colour camera's
/// clock, seconds, as tracking found it.
[[nodiscard]] Adjusted adjust(BackEnd& back_end, const Rig& rig, double clock_offset);

}  // namespace cairn
