// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "cairn/frame.hpp"

namespace cairn {

/// Finds the colour camera of a sensor from what it saw, without knowing where it stood: where depth jumps, colour
/// mostly has an edge too (as Levinson & Thrun 2013 lay a laser over a camera). Turn, place and focal length are
/// searched near what source.rig() promises: 4 degrees, 12 cm and a fifth of the length to each side; the principal
/// point and the lens are taken as they are.
///
/// `frames` of the source, spread over all of it, are read; those before them are passed over. Nothing where the rig
/// promised is about as good, or where too few edges are seen. The same frames give the same rig.
[[nodiscard]] std::optional<Rig> find_colour_camera(Source& source, int frames = 40);

/// How long a camera takes to read the rows of an image.
struct FoundShutter {
  Rig rig;                     ///< the source's, with the readout that was found for both of its cameras
  double readout = 0;          ///< seconds from the first row to the last; 0: none was found
  double sigma = 0;            ///< seconds, its standard deviation
  double predicts_better = 0;  ///< share by which surfaces that were held out are predicted better with it than without
  int keyframes = 0;           ///< that it was found with
  std::string why_not;         ///< in one line; empty: found
};
/// Finds it by tracking the recording and adjusting keyframes, surface and readout together (Mapper::adjust), again
/// with what was found, until that settles; one readout for both cameras. `open` gives the recording from its begin
/// each time, at most three; `step` is called after each tracked frame. A readout is only believed where it predicts
/// measurements that it was not found with. The same frames give the same readout.
[[nodiscard]] FoundShutter find_shutter(const std::function<std::unique_ptr<Source>()>& open,
                                        const std::function<void()>& step = {});

/// What the cameras of a sensor are.
struct FoundCalibration {
  Rig rig;                     ///< the source's, or as it was found: cameras, lenses, readout, what depth errs by
  double clock_offset = 0;     ///< seconds that the colour camera's clock is ahead; tracking finds it in each run
  double readout_sigma = 0;    ///< seconds, the standard deviation of the readout
  double predicts_better = 0;  ///< share by which surfaces that were held out are predicted better with it than without
  int keyframes = 0;           ///< that it was found with
  std::string why_not;         ///< in one line; empty: found
};
/// Finds focal lengths, principal points, the first radial term of lenses, where the colour camera is, the readout of
/// rows and what depth errs by, all together, by tracking the recording and adjusting keyframes and surface with them.
/// `open` gives the recording from its begin, once; `step` is called after each tracked frame. Refused where the first
/// half of the recording tells another focal length than the second by more than 1 %. Only believed where it
/// predicts measurements that it was not found with. The same frames give the same cameras.
[[nodiscard]] FoundCalibration find_calibration(const std::function<std::unique_ptr<Source>()>& open,
                                                const std::function<void()>& step = {});

/// What a depth camera errs by.
struct FoundDepthCorrection {
  Rig rig;                     ///< the source's, with the correction that was found
  double predicts_better = 0;  ///< share by which surfaces that were held out are predicted better with it than without
  int keyframes = 0;           ///< that it was found with
  std::string why_not;         ///< in one line; empty: found
};
/// Finds it by tracking the recording and adjusting keyframes, surface and correction together (Mapper::adjust), and
/// once more with what was found. `open` gives the recording from its begin each time, twice; `step` is called after
/// each tracked frame. A correction is only believed where it predicts measurements that it was not found with; where
/// nothing was seen it is 0. The same frames give the same correction.
[[nodiscard]] FoundDepthCorrection find_depth_correction(const std::function<std::unique_ptr<Source>()>& open,
                                                         const std::function<void()>& step = {});

}  // namespace cairn
