// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/adjust.hpp"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>

#include "bundle/bundle.hpp"
#include "geometry/readout.hpp"
#include "geometry/velocity.hpp"
#include "mapper/refine.hpp"

namespace cairn {
namespace {

// Seconds; standard deviations: smallest readout worth a second adjustment.
constexpr double kMinReadout = 0.001, kMinReadoutSigmas = 4;
constexpr double kMaxReadoutSigma = 0.0015;  // s; max. standard deviation of a usable readout
// Min. reduction of the held-out surfels' error, as a share of it:
constexpr double kMinErrorReduction = 0.003;             // by a readout
constexpr double kMinCorrectionErrorReduction = 0.01;    // by a depth correction
constexpr double kClearCorrectionErrorReduction = 0.05;  // same, after few rounds without it
constexpr int kEarlyRounds = 2;
constexpr int kMinKeyframes = 8;       // fewer are too few to estimate a depth correction
constexpr double kUnknownSigma = 0.1;  // m; sigma of a surfel without observations
constexpr std::size_t kReadAhead = 4;  // keyframes
// Views from which every second view is adjusted first, and the views between follow: coarse rounds of 267 views in
// 12.4 instead of 33.7 s of CPU, ATE 0.127 instead of 0.124 cm.
constexpr std::size_t kMinHalvedViews = 120;
constexpr int kTypicalRounds = 30;  // typical number over all bundles, for the progress

/// Counts the rounds of consecutive bundle adjustments and reports them as one progress.
struct Rounds {
  const ProgressCallback& progress;
  int done = 0;
  bool is_stopped = false;
  bool operator()() {
    ++done;
    if (progress && !is_stopped) is_stopped = !progress(std::min(1.0, static_cast<double>(done) / kTypicalRounds));
    return !is_stopped;
  }
};

Bundle bundle_of(const BackEnd& back_end, const Rig& rig, double clock_offset,
                 const std::vector<std::size_t>& keyframes, const ProgressCallback& progress = {}) {
  const Atlas& atlas = back_end.atlas();
  const Trajectory path = atlas.trajectory(atlas.main_component(), 0, atlas.frames.size());
  Bundle bundle(rig);
  std::vector<std::optional<std::size_t>> view_of(atlas.keyframes.size());
  const auto in_order = tbb::filter_mode::serial_in_order;
  std::size_t next = 0;
  bool is_stopped = false;
  const auto read = [&](tbb::flow_control& control) -> std::shared_ptr<Frame> {
    is_stopped = progress && !progress(0);
    if (next == keyframes.size() || is_stopped) {
      control.stop();
      return nullptr;
    }
    const std::size_t k = keyframes[next++];
    auto frame = std::make_shared<Frame>(back_end.images().get(k));
    frame->timestamp = atlas.keyframes[k].timestamp;
    frame->color_delay = atlas.keyframes[k].color_delay - clock_offset;
    return frame;
  };
  const auto prepare = [&](const std::shared_ptr<Frame>& frame) {
    return std::make_shared<BundleView>(bundle.view(*frame, motion_at(path, frame->timestamp)));
  };
  std::size_t view = 0;
  const auto add = [&](const std::shared_ptr<BundleView>& prepared) {
    const std::size_t k = keyframes[view];
    bundle.add(std::move(*prepared), atlas.world_from_camera[k]);
    view_of[k] = view++;
  };
  tbb::parallel_pipeline(kReadAhead, tbb::make_filter<void, std::shared_ptr<Frame>>(in_order, read) &
                                         tbb::make_filter<std::shared_ptr<Frame>, std::shared_ptr<BundleView>>(
                                             tbb::filter_mode::parallel, prepare) &
                                         tbb::make_filter<std::shared_ptr<BundleView>, void>(in_order, add));
  if (is_stopped) throw std::runtime_error(kInterrupted);
  for (PoseGraph::Edge edge : atlas.graph().edges) {
    const auto i = view_of[edge.i], j = view_of[edge.j];
    if (edge.is_loop_closure || !i || !j) continue;
    edge.i = *i, edge.j = *j;
    bundle.add_edge(edge);
  }
  return bundle;
}

/// Share of the held-out surfels' error of `without` by which `with` reduces the error.
double error_reduction(Bundle& with, Bundle& without) {
  const double before = without.held_out_error();
  return before > 0 ? 1 - with.held_out_error() / before : 0;
}

/// Drops an estimated readout without confirmation by held-out surfels.
void check_readout(Bundle& bundle, AdjustReport& adjusted, Rounds& rounds) {
  adjusted.readout = bundle.shutter().readout;
  adjusted.readout_sigma = bundle.readout_sigma();
  if (rounds.is_stopped ||
      std::abs(adjusted.readout) <= std::max(kMinReadout, kMinReadoutSigmas * adjusted.readout_sigma))
    return;
  Bundle global = bundle;
  global.adjust(false, Bundle::Detail::coarse, std::ref(rounds));
  adjusted.error_reduction = error_reduction(bundle, global);
  adjusted.has_readout = adjusted.error_reduction >= kMinErrorReduction;
  if (!adjusted.has_readout) bundle = std::move(global);
}

/// Drops an estimated depth correction without confirmation by held-out surfels.
void check_correction(Bundle& bundle, AdjustReport& adjusted, Rounds& rounds) {
  if (rounds.is_stopped) return;
  Bundle without = bundle;
  without.forget_correction();
  int done = 0;
  const auto progress = [&] {
    if (!rounds()) return false;
    if (++done != kEarlyRounds) return true;
    adjusted.corrected_error_reduction = error_reduction(bundle, without);
    return adjusted.corrected_error_reduction < kClearCorrectionErrorReduction;
  };
  without.adjust(adjusted.has_readout, Bundle::Detail::coarse, progress);
  if (rounds.is_stopped || adjusted.corrected_error_reduction >= kClearCorrectionErrorReduction) return;
  adjusted.corrected_error_reduction = error_reduction(bundle, without);
  if (adjusted.corrected_error_reduction < kMinCorrectionErrorReduction) bundle = std::move(without);
}

/// Adjusts the poses together with the readout, unless the shutter is known, and the depth correction.
void adjust_coarsely(Bundle& bundle, bool finds_readout, bool finds_correction, AdjustReport& adjusted,
                     Rounds& rounds) {
  if (finds_correction) bundle.find_correction();
  bundle.adjust(finds_readout, Bundle::Detail::coarse, std::ref(rounds));
  if (finds_readout) check_readout(bundle, adjusted, rounds);
  if (finds_correction) check_correction(bundle, adjusted, rounds);
}

void update_uncertainty(const Bundle& bundle, Atlas& atlas, const std::vector<std::size_t>& keyframes,
                        AdjustReport& adjusted) {
  atlas.surface_sigma = {};  // computed before the surface moved
  atlas.steps.clear();
  const std::optional<BundleCovariance> covariance = bundle.covariance();
  if (!covariance) return;
  for (std::size_t view = 0; view < keyframes.size(); ++view)
    adjusted.covariances.push_back({atlas.keyframes[keyframes[view]].timestamp, covariance->of_views[view]});
  atlas.steps.resize(atlas.keyframes.size());
  for (std::size_t view = 1; view < keyframes.size(); ++view)
    if (const std::size_t k = keyframes[view]; keyframes[view - 1] == k - 1 && atlas.keyframes[k].follows)
      atlas.steps[k] = {atlas.world_from_camera[k - 1].inverse() * atlas.world_from_camera[k],
                        covariance->of_steps[view].inverse()};
  for (const auto& surfel : covariance->of_surfels)
    if (const double sigma = std::sqrt(surfel.of_noise + surfel.of_poses); sigma < kUnknownSigma)
      atlas.surface_sigma.add(surfel.position, sigma);
}

}  // namespace

AdjustReport adjust(BackEnd& back_end, const Rig& rig, double clock_offset, AdjustedParameters parameters,
                    const ProgressCallback& progress) {
  back_end.finish_optimization();
  Atlas& atlas = back_end.atlas();
  if (atlas.keyframes.size() < 2) return {.keyframes = static_cast<int>(atlas.keyframes.size())};
  const std::vector<std::size_t> keyframes = atlas.main_keyframes();
  AdjustReport adjusted{.keyframes = static_cast<int>(keyframes.size())};
  if (keyframes.size() < 2) return adjusted;
  Bundle bundle = bundle_of(back_end, rig, clock_offset, keyframes, progress);
  Rounds rounds{.progress = progress};
  const bool finds_correction =
      parameters == AdjustedParameters::readout_and_depth && adjusted.keyframes >= kMinKeyframes;
  if (bundle.views() < kMinHalvedViews) {
    adjust_coarsely(bundle, !is_rolling(rig), finds_correction, adjusted, rounds);
  } else {
    Bundle second = bundle.every_second();
    adjust_coarsely(second, !is_rolling(rig), finds_correction, adjusted, rounds);
    bundle.follow(second);
  }
  if (!rounds.is_stopped) bundle.adjust(adjusted.has_readout, Bundle::Detail::fine, std::ref(rounds));
  adjusted.correction = bundle.correction();
  if (adjusted.has_readout) adjusted.readout = bundle.shutter().readout;
  adjusted.surfels = static_cast<int>(bundle.surfels());
  adjusted.observations = static_cast<int>(bundle.observations());
  adjusted.clock_offset = clock_offset + bundle.shutter().clock;
  for (std::size_t view = 0; view < keyframes.size(); ++view)
    atlas.world_from_camera[keyframes[view]] = bundle.world_from_view()[view];
  update_uncertainty(bundle, atlas, keyframes, adjusted);
  return adjusted;
}

bool is_readout_precise(const AdjustReport& adjusted) {
  return adjusted.readout_sigma > 0 && adjusted.readout_sigma < kMaxReadoutSigma;
}

double usable_readout(const AdjustReport& adjusted) {
  const bool is_usable = adjusted.keyframes >= kMinKeyframes && adjusted.has_readout && is_readout_precise(adjusted) &&
                         adjusted.readout >= kMinReadout && adjusted.readout <= kMaxReadout;
  return is_usable ? adjusted.readout : 0;
}

namespace {

Bundle with_cameras(Bundle bundle) {
  bundle.clear_edges();  // measured with cameras that may be wrong
  bundle.find_cameras(), bundle.find_correction();
  bundle.adjust(true, Bundle::Detail::medium);
  return bundle;
}

}  // namespace

AdjustedCameras adjust_cameras(BackEnd& back_end, const Rig& rig, double clock_offset) {
  back_end.finish_optimization();
  const Atlas& atlas = back_end.atlas();
  const std::vector<std::size_t> keyframes =
      atlas.keyframes.empty() ? std::vector<std::size_t>{} : atlas.main_keyframes();
  AdjustedCameras found{.rig = rig, .clock_offset = clock_offset, .keyframes = static_cast<int>(keyframes.size())};
  if (keyframes.size() < kMinKeyframes) return found;
  Bundle uncalibrated = bundle_of(back_end, rig, clock_offset, keyframes);
  Bundle bundle = with_cameras(uncalibrated);
  uncalibrated.clear_edges(), uncalibrated.adjust(false, Bundle::Detail::medium);
  found.error_reduction = error_reduction(bundle, uncalibrated);
  found.rig = bundle.rig();
  found.rig.depth_correction = rig.depth_correction.compose(bundle.correction());
  found.readout = bundle.shutter().readout, found.readout_sigma = bundle.readout_sigma();
  found.clock_offset = clock_offset + bundle.shutter().clock;
  return found;
}

double focal_length_change(BackEnd& back_end, const Rig& rig, double clock_offset) {
  const std::vector<std::size_t> keyframes = back_end.atlas().main_keyframes();
  const auto middle = keyframes.begin() + static_cast<std::ptrdiff_t>(keyframes.size() / 2);
  const auto camera_of = [&](auto from, auto to) {
    return with_cameras(bundle_of(back_end, rig, clock_offset, {from, to})).rig().depth;
  };
  const Camera first = camera_of(keyframes.begin(), middle), second = camera_of(middle, keyframes.end());
  return (first.fx + first.fy) / (second.fx + second.fy) - 1;
}

}  // namespace cairn
