// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>

#include "cairn/reports.hpp"
#include "map/back_end.hpp"

namespace cairn {

/// Told the share that is done; says whether to go on.
using GoesOn = std::function<bool(double)>;

/// Beside poses, surface and clock: what the depth camera errs by as well, or the readout alone.
enum class Sought { readout_and_depth, readout };

/// Moves the keyframes of the main piece to where all that they see agrees best. `clock_offset`: of the colour camera's
/// clock, seconds, as tracking found it. `goes_on` is asked from time to time, see Bundle::adjust.
[[nodiscard]] Adjusted adjust(BackEnd& back_end, const Rig& rig, double clock_offset, Sought sought,
                              const GoesOn& goes_on = {});

}  // namespace cairn
