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

/// What keyframes tell of the cameras that took them.
struct AdjustedCameras {
  static constexpr double kBetter = 0.01;  // what predicts_better must be for them to be believed
  Rig rig;             // what was given, with what was found: cameras, what depth errs by; the readout is not in it
  double readout = 0;  // seconds, what is left of it; and its standard deviation
  double readout_sigma = 0;
  double clock_offset = 0;     // seconds that the colour camera's clock is ahead
  double predicts_better = 0;  // share by which held-out surfels are predicted better than with the cameras as given
  int keyframes = 0;
};
/// Moves nothing: keyframes that were placed by wrong cameras are to be tracked again. `rig`: of images of one moment.
[[nodiscard]] AdjustedCameras adjust_cameras(BackEnd& back_end, const Rig& rig, double clock_offset);
/// Share by which focal lengths are longer that the first half of keyframes tells than those that the second tells: of
/// a camera that was refocused nothing can be told that holds for all of its images. `rig` as above.
[[nodiscard]] double refocused_by(BackEnd& back_end, const Rig& rig, double clock_offset);

}  // namespace cairn
