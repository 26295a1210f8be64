// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/calibrate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cairn/mapper.hpp"
#include "map/adjust.hpp"
#include "map/map_state.hpp"
#include "surface/rectify.hpp"

namespace cairn {
namespace {

constexpr int kMostPasses = 3;  // for a readout
constexpr int kDepthPasses = 2;
constexpr double kSettled = 0.001;    // s; convergence of the readout between passes
constexpr double kLongest = 0.1;      // s; no camera is slower
constexpr double kSharpest = 0.0015;  // s; max. standard deviation of a usable readout
constexpr int kFewKeyframes = 8;
constexpr double kRefocused = 0.01;  // relative difference of focal length between the halves
constexpr float kVoxel = 0.02f;      // m; this map is not exported

std::string moved_too_little(int keyframes) {
  return fmt::format("the camera moved too little: {} keyframes, {} are needed", keyframes, kFewKeyframes);
}

void set_readout(Rig& rig, double readout) {
  rig.depth.readout = readout;
  if (rig.colour) rig.colour->camera.readout = readout;
}

Mapper track(Source& source, const Rig& rig, const std::function<void()>& step) {
  Mapper mapper(rig, options_for(rig.sensor, kVoxel));
  while (const auto frame = source.next()) {
    mapper.add(*frame);
    if (step) step();
  }
  return mapper;
}

/// Estimates the remaining readout: the keyframes' images are already corrected for the given one.
Adjusted adjust_as_if_not_told(Mapper& mapper) {
  MapState& s = *mapper.state();
  return adjust(s.back_end, at_one_moment(s.rig), s.tracker.clock_offset(), Sought::readout);
}

/// Empty, or the reason why no single calibration fits all keyframes.
std::string refocused(MapState& s) {
  const double by = refocused_by(s.back_end, at_one_moment(s.rig), s.tracker.clock_offset());
  if (std::abs(by) <= kRefocused) return {};
  return fmt::format(
      "the focal length of the recording's first half is {:+.1f} % off that of its second: no camera fits both",
      100 * by);
}

}  // namespace

FoundShutter find_shutter(const std::function<std::unique_ptr<Source>()>& open, const std::function<void()>& step) {
  auto source = open();
  FoundShutter found{.rig = source->rig()};
  if (found.rig.depth.readout > 0 || found.rig.colour_view().readout > 0) {
    found.why_not = "the camera's readout is told already";
    return found;
  }
  double readout = 0;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    Rig rig = found.rig;
    set_readout(rig, readout);
    if (pass > 0) source = open();
    Mapper mapper = track(*source, rig, step);
    const Adjusted adjusted = adjust_as_if_not_told(mapper);
    found.keyframes = adjusted.keyframes;
    found.sigma = adjusted.readout_sigma;
    if (pass == 0) {
      found.predicts_better = adjusted.predicts_better;
      if (adjusted.keyframes < kFewKeyframes)
        found.why_not = moved_too_little(adjusted.keyframes);
      else if (!(adjusted.readout_sigma > 0 && adjusted.readout_sigma < kSharpest))
        found.why_not = "the camera turned too slowly to tell when its rows were taken";
      else if (!adjusted.has_readout || adjusted.readout < 0)
        found.why_not = "all rows were taken at once, as far as held-out measurements tell";
      if (!found.why_not.empty()) return found;
    }
    readout = std::clamp(readout + adjusted.readout, 0.0, kLongest);
    if (std::abs(adjusted.readout) < kSettled) break;
  }
  found.readout = readout;
  set_readout(found.rig, readout);
  return found;
}

FoundCalibration find_calibration(const std::function<std::unique_ptr<Source>()>& open,
                                  const std::function<void()>& step) {
  const auto source = open();
  FoundCalibration found{.rig = source->rig()};
  Mapper mapper = track(*source, found.rig, step);
  MapState& s = *mapper.state();
  const AdjustedCameras adjusted = adjust_cameras(s.back_end, at_one_moment(found.rig), s.tracker.clock_offset());
  found.keyframes = adjusted.keyframes;
  found.predicts_better = adjusted.predicts_better;
  if (adjusted.keyframes < kFewKeyframes)
    found.why_not = moved_too_little(adjusted.keyframes);
  else if (adjusted.predicts_better < AdjustedCameras::kBetter)
    found.why_not = "the cameras are what they are said to be, as far as held-out measurements tell";
  else
    found.why_not = refocused(s);
  if (!found.why_not.empty()) return found;
  const double readout = std::clamp(found.rig.depth.readout + adjusted.readout, 0.0, kLongest);
  found.rig = adjusted.rig;
  set_readout(found.rig, readout < kSettled ? 0 : readout);
  found.clock_offset = adjusted.clock_offset;
  found.readout_sigma = adjusted.readout_sigma;
  return found;
}

FoundDepthCorrection find_depth_correction(const std::function<std::unique_ptr<Source>()>& open,
                                           const std::function<void()>& step) {
  auto source = open();
  FoundDepthCorrection found{.rig = source->rig()};
  for (int pass = 0; pass < kDepthPasses; ++pass) {
    Rig rig = found.rig;
    if (pass > 0) source = open();
    Mapper mapper = track(*source, rig, step);
    const Adjusted adjusted = mapper.adjust();
    if (pass == 0) {
      found.keyframes = adjusted.keyframes;
      found.predicts_better = adjusted.corrected_predicts_better;
      if (adjusted.keyframes < kFewKeyframes)
        found.why_not = moved_too_little(adjusted.keyframes);
      else if (adjusted.correction.empty())
        found.why_not = "depth errs by no more than its noise, as far as held-out measurements tell";
      else
        found.why_not = refocused(*mapper.state());
      if (!found.why_not.empty()) return found;
    }
    // The first correction was estimated on poses tracked without it.
    found.rig.depth_correction = found.rig.depth_correction.then(adjusted.correction);
  }
  return found;
}

}  // namespace cairn
