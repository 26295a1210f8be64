// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <string>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Readout time of a rolling shutter.
struct FoundShutter {
  Rig rig;                     ///< rig of the source, with the estimated readout in both cameras
  double readout = 0;          ///< seconds from the first row to the last; 0: not found
  double sigma = 0;            ///< standard deviation of the readout, seconds
  double error_reduction = 0;  ///< relative reduction of the prediction error of held-out surfaces
  int keyframes = 0;           ///< number of keyframes used
  std::string failure_reason;  ///< one line; empty: found
};
/// Estimates the readout time by tracking the recording and adjusting keyframes, surface and readout jointly
/// (Mapper::adjust), repeated with the estimate until it converges; one readout for both cameras. `open` opens the
/// recording from its start, at most three times; `step` is called after each tracked frame. The readout is accepted
/// only if it improves the prediction of held-out measurements. Deterministic for the same frames.
[[nodiscard]] FoundShutter find_shutter(const std::function<std::unique_ptr<Source>()>& open,
                                        const std::function<void()>& step = {});

/// Calibration of a sensor's cameras.
struct FoundCalibration {
  Rig rig;                     ///< rig of the source or of the estimate: cameras, lenses, readout, depth correction
  double clock_offset = 0;     ///< seconds by which the color camera's clock is ahead; tracking estimates it in each
                               ///< run
  double readout_sigma = 0;    ///< standard deviation of the readout, seconds
  double error_reduction = 0;  ///< relative reduction of the prediction error of held-out surfaces
  int keyframes = 0;           ///< number of keyframes used
  std::string failure_reason;  ///< one line; empty: found
};
/// Estimates focal lengths, principal points, the first radial distortion term, the color camera's extrinsics, the
/// readout time and the depth correction jointly, by tracking the recording and adjusting keyframes and surface with
/// them. `open` opens the recording from its start, once; `step` is called after each tracked frame. Rejected if the
/// focal lengths from the two halves of the recording differ by more than 1 %. Accepted only if it improves the
/// prediction of held-out measurements. Deterministic for the same frames.
[[nodiscard]] FoundCalibration find_calibration(const std::function<std::unique_ptr<Source>()>& open,
                                                const std::function<void()>& step = {});

/// Depth correction of a depth camera.
struct FoundDepthCorrection {
  Rig rig;                     ///< rig of the source, with the estimated correction
  double error_reduction = 0;  ///< relative reduction of the prediction error of held-out surfaces
  int keyframes = 0;           ///< number of keyframes used
  std::string failure_reason;  ///< one line; empty: found
};
/// Estimates the depth correction by tracking the recording and adjusting keyframes, surface and correction jointly
/// (Mapper::adjust), and once more with the estimate. `open` opens the recording from its start each time, twice;
/// `step` is called after each tracked frame. A correction is accepted only if it improves the prediction of held-out
/// measurements; without observations it is 0. Deterministic for the same frames.
[[nodiscard]] FoundDepthCorrection find_depth_correction(const std::function<std::unique_ptr<Source>()>& open,
                                                         const std::function<void()>& step = {});

}  // namespace cairn
