// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/calibrate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/mapping/mapper.hpp"
#include "geometry/readout.hpp"
#include "mapper/access.hpp"
#include "mapper/adjust.hpp"
#include "mapper/map_state.hpp"

namespace cairn {
namespace {

constexpr int kMaxPasses = 3;  // for a readout
constexpr int kDepthPasses = 2;
constexpr double kConvergedReadout = 0.001;  // s; convergence of the readout between passes
constexpr int kMinKeyframes = 8;
constexpr double kMaxFocalLengthChange = 0.01;  // relative difference of focal length between the halves
constexpr float kVoxelSize = 0.02f;             // m; this map is not exported

std::string moved_too_little(int keyframes) {
  return fmt::format("the camera moved too little: {} keyframes, {} are needed", keyframes, kMinKeyframes);
}

Mapper track(Source& source, const Rig& rig, const std::function<void()>& step) {
  Mapper mapper(rig, options_for(rig.sensor, kVoxelSize));
  while (const auto frame = source.next()) {
    mapper.add(*frame);
    if (step) step();
  }
  return mapper;
}

/// Estimates the remaining readout: the keyframes' images are already corrected for the given one.
AdjustReport adjust_readout(Mapper& mapper) {
  MapState& s = *MapperAccess::state(mapper);
  return adjust(s.back_end, with_global_shutter(s.rig), s.tracker.clock_offset(), AdjustedParameters::readout);
}

/// Empty, or the reason why no single calibration fits all keyframes.
std::string focal_length_problem(MapState& s) {
  const double by = focal_length_change(s.back_end, with_global_shutter(s.rig), s.tracker.clock_offset());
  if (std::abs(by) <= kMaxFocalLengthChange) return {};
  return fmt::format(
      "the focal length of the recording's first half differs by {:+.1f} % from the second's: no single calibration "
      "fits both",
      100 * by);
}

}  // namespace

FoundShutter find_shutter(const std::function<std::unique_ptr<Source>()>& open, const std::function<void()>& step) {
  auto source = open();
  FoundShutter found{.rig = source->rig()};
  if (found.rig.depth.readout > 0 || found.rig.color_view().readout > 0) {
    found.failure_reason = "the camera already has a readout time";
    return found;
  }
  double readout = 0;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    const Rig rig = with_readout(found.rig, readout);
    if (pass > 0) source = open();
    Mapper mapper = track(*source, rig, step);
    const AdjustReport adjusted = adjust_readout(mapper);
    found.keyframes = adjusted.keyframes;
    found.sigma = adjusted.readout_sigma;
    if (pass == 0) {
      found.error_reduction = adjusted.error_reduction;
      if (adjusted.keyframes < kMinKeyframes)
        found.failure_reason = moved_too_little(adjusted.keyframes);
      else if (!is_readout_precise(adjusted))
        found.failure_reason = "the camera turned too slowly to estimate the readout time";
      else if (!adjusted.has_readout || adjusted.readout < 0)
        found.failure_reason = "held-out measurements show no rolling shutter";
      if (!found.failure_reason.empty()) return found;
    }
    readout = std::clamp(readout + adjusted.readout, 0.0, kMaxReadout);
    if (std::abs(adjusted.readout) < kConvergedReadout) break;
  }
  found.readout = readout;
  found.rig = with_readout(std::move(found.rig), readout);
  return found;
}

FoundCalibration find_calibration(const std::function<std::unique_ptr<Source>()>& open,
                                  const std::function<void()>& step) {
  const auto source = open();
  FoundCalibration found{.rig = source->rig()};
  Mapper mapper = track(*source, found.rig, step);
  MapState& s = *MapperAccess::state(mapper);
  const AdjustedCameras adjusted = adjust_cameras(s.back_end, with_global_shutter(found.rig), s.tracker.clock_offset());
  found.keyframes = adjusted.keyframes;
  found.error_reduction = adjusted.error_reduction;
  if (adjusted.keyframes < kMinKeyframes)
    found.failure_reason = moved_too_little(adjusted.keyframes);
  else if (adjusted.error_reduction < AdjustedCameras::kMinErrorReduction)
    found.failure_reason = "held-out measurements do not confirm a better calibration";
  else
    found.failure_reason = focal_length_problem(s);
  if (!found.failure_reason.empty()) return found;
  const double readout = std::clamp(found.rig.depth.readout + adjusted.readout, 0.0, kMaxReadout);
  found.rig = with_readout(adjusted.rig, readout < kConvergedReadout ? 0 : readout);
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
    const AdjustReport adjusted = mapper.adjust();
    if (pass == 0) {
      found.keyframes = adjusted.keyframes;
      found.error_reduction = adjusted.corrected_error_reduction;
      if (adjusted.keyframes < kMinKeyframes)
        found.failure_reason = moved_too_little(adjusted.keyframes);
      else if (adjusted.correction.empty())
        found.failure_reason = "held-out measurements do not confirm a depth correction";
      else
        found.failure_reason = focal_length_problem(*MapperAccess::state(mapper));
      if (!found.failure_reason.empty()) return found;
    }
    // The first correction was estimated on poses tracked without it.
    found.rig.depth_correction = found.rig.depth_correction.compose(adjusted.correction);
  }
  return found;
}

}  // namespace cairn
