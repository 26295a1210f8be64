// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>

#include "cairn/mapping/reports.hpp"
#include "mapper/back_end.hpp"

namespace cairn {

/// Progress callback: receives the share that is done, returns false to stop.
using ProgressCallback = std::function<bool(double)>;

/// Parameters estimated in addition to poses, surface and clock: the readout alone, or also a depth correction.
enum class AdjustedParameters { readout_and_depth, readout };

/// Bundle adjustment of the keyframes of the main component. `clock_offset`: of the color camera's clock, seconds, as
/// estimated by tracking. `progress` is called from time to time, see Bundle::adjust.
[[nodiscard]] AdjustReport adjust(BackEnd& back_end, const Rig& rig, double clock_offset, AdjustedParameters parameters,
                                  const ProgressCallback& progress = {});

inline constexpr double kMaxReadout = 0.1;  // s; no camera is slower
/// True if the camera turned fast enough to estimate a readout.
[[nodiscard]] bool is_readout_precise(const AdjustReport& adjusted);
/// Readout for the cameras, seconds; 0 unless it is precise, positive, and confirmed by held-out surfels.
[[nodiscard]] double usable_readout(const AdjustReport& adjusted);

/// Camera parameters estimated from keyframes.
struct AdjustedCameras {
  static constexpr double kMinErrorReduction = 0.01;  // min. error_reduction to accept the cameras
  Rig rig;             // the given rig with the estimated cameras and depth correction; the readout is unchanged
  double readout = 0;  // s, in addition to the given readout; and its standard deviation
  double readout_sigma = 0;
  double clock_offset = 0;     // s by which the color camera's clock is ahead
  double error_reduction = 0;  // relative reduction of the held-out surfels' error, against the given cameras
  int keyframes = 0;
};
/// Estimates the cameras and leaves all poses unchanged: keyframes with poses from wrong cameras must be tracked again.
/// `rig`: without readout, for images without rolling shutter.
[[nodiscard]] AdjustedCameras adjust_cameras(BackEnd& back_end, const Rig& rig, double clock_offset);
/// Relative difference of the focal lengths estimated from the first and the second half of the keyframes, positive if
/// the first is longer. A camera that was refocused has no calibration valid for all of its images. `rig` as above.
[[nodiscard]] double focal_length_change(BackEnd& back_end, const Rig& rig, double clock_offset);

}  // namespace cairn
