// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/adjust.hpp"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>

#include "adjust/bundle.hpp"
#include "base/velocity.hpp"
#include "map/refine.hpp"
#include "surface/rectify.hpp"

namespace cairn {
namespace {

constexpr double kSign = 0.001, kSigmas = 4;  // s; standard deviations: smallest readout worth a second adjustment
constexpr double kBetter = 0.003;             // min. share of the held-out surfels' error that a readout must remove
constexpr double kBetterCorrected = 0.01;     // the same for a depth correction
constexpr double kPromising = 0.002;          // the same for a depth correction, after its first rounds
constexpr int kFirstRounds = 2;
constexpr int kFewKeyframes = 8;       // too few to estimate a depth correction
constexpr double kUnknown = 0.1;       // m; sigma of a surfel without observations
constexpr std::size_t kReadAhead = 4;  // keyframes
constexpr int kUsualRounds = 30;       // typical number over all bundles, for the progress

/// Counts the rounds of consecutive bundle adjustments and reports them as one progress.
struct Rounds {
  const GoesOn& goes_on;
  int done = 0;
  bool is_stopped = false;
  bool operator()() {
    ++done;
    if (goes_on && !is_stopped) is_stopped = !goes_on(std::min(1.0, static_cast<double>(done) / kUsualRounds));
    return !is_stopped;
  }
};

Bundle bundle_of(const BackEnd& back_end, const Rig& rig, double clock_offset,
                 const std::vector<std::size_t>& keyframes, const GoesOn& goes_on = {}) {
  const Atlas& atlas = back_end.atlas();
  const Trajectory path = atlas.trajectory(atlas.main_component(), 0, atlas.frames.size());
  Bundle bundle(rig);
  std::vector<std::optional<std::size_t>> view_of(atlas.keyframes.size());
  const auto in_order = tbb::filter_mode::serial_in_order;
  std::size_t next = 0;
  bool is_stopped = false;
  const auto read = [&](tbb::flow_control& control) -> std::shared_ptr<Frame> {
    is_stopped = goes_on && !goes_on(0);
    if (next == keyframes.size() || is_stopped) {
      control.stop();
      return nullptr;
    }
    const std::size_t k = keyframes[next++];
    auto frame = std::make_shared<Frame>(back_end.images().get(k));
    frame->timestamp = atlas.keyframes[k].timestamp;
    frame->colour_delay = atlas.keyframes[k].colour_delay - clock_offset;
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
  if (is_stopped) throw std::runtime_error(kEnded);
  for (PoseGraph::Edge edge : atlas.graph().edges) {
    const auto i = view_of[edge.i], j = view_of[edge.j];
    if (edge.is_loop_closure || !i || !j) continue;
    edge.i = *i, edge.j = *j;
    bundle.tie(edge);
  }
  return bundle;
}

/// Share of the held-out surfels' error of `without` by which `with` reduces the error.
double predicts_better(Bundle& with, Bundle& without) {
  const double before = without.held_out_error();
  return before > 0 ? 1 - with.held_out_error() / before : 0;
}

/// Estimates the readout of cameras without a known rolling shutter.
void find_shutter(Bundle& bundle, const Rig& rig, Adjusted& adjusted, Rounds& rounds) {
  const bool is_told = is_rolling(rig);
  bundle.adjust(!is_told, Bundle::Detail::coarse, std::ref(rounds));
  if (is_told) return;
  adjusted.readout = bundle.shutter().readout;
  adjusted.readout_sigma = bundle.readout_sigma();
  if (rounds.is_stopped || std::abs(adjusted.readout) <= std::max(kSign, kSigmas * adjusted.readout_sigma)) return;
  Bundle global = bundle;
  global.adjust(false, Bundle::Detail::coarse, std::ref(rounds));
  adjusted.predicts_better = predicts_better(bundle, global);
  adjusted.has_readout = adjusted.predicts_better >= kBetter;
  if (!adjusted.has_readout) bundle = std::move(global);
}

void find_correction(Bundle& bundle, Adjusted& adjusted, Rounds& rounds) {
  if (rounds.is_stopped || adjusted.keyframes < kFewKeyframes) return;
  Bundle corrected = bundle;
  corrected.find_correction();
  int done = 0;
  bool is_promising = true;
  const auto goes_on = [&] {
    if (!rounds()) return false;
    if (++done != kFirstRounds) return true;
    adjusted.corrected_predicts_better = predicts_better(corrected, bundle);
    return is_promising = adjusted.corrected_predicts_better >= kPromising;
  };
  corrected.adjust(adjusted.has_readout, Bundle::Detail::coarse, goes_on);
  if (rounds.is_stopped || !is_promising) return;
  bundle.adjust(adjusted.has_readout, Bundle::Detail::coarse, std::ref(rounds));
  if (rounds.is_stopped) return;
  adjusted.corrected_predicts_better = predicts_better(corrected, bundle);
  if (adjusted.corrected_predicts_better >= kBetterCorrected) bundle = std::move(corrected);
}

void tell_uncertainty(const Bundle& bundle, Atlas& atlas, const std::vector<std::size_t>& keyframes,
                      Adjusted& adjusted) {
  atlas.surface_sigma = {};  // computed before the surface moved
  atlas.steps.clear();
  const std::optional<BundleCovariance> known = bundle.covariance();
  if (!known) return;
  for (std::size_t view = 0; view < keyframes.size(); ++view)
    adjusted.covariances.push_back({atlas.keyframes[keyframes[view]].timestamp, known->of_views[view]});
  atlas.steps.resize(atlas.keyframes.size());
  for (std::size_t view = 1; view < keyframes.size(); ++view)
    if (const std::size_t k = keyframes[view]; keyframes[view - 1] == k - 1 && atlas.keyframes[k].follows)
      atlas.steps[k] = {atlas.world_from_camera[k - 1].inverse() * atlas.world_from_camera[k],
                        known->of_steps[view].inverse()};
  for (const auto& surfel : known->of_surfels)
    if (const double sigma = std::sqrt(surfel.of_noise + surfel.of_poses); sigma < kUnknown)
      atlas.surface_sigma.add(surfel.position, sigma);
}

}  // namespace

Adjusted adjust(BackEnd& back_end, const Rig& rig, double clock_offset, Sought sought, const GoesOn& goes_on) {
  back_end.settle();
  Atlas& atlas = back_end.atlas();
  if (atlas.keyframes.size() < 2) return {.keyframes = static_cast<int>(atlas.keyframes.size())};
  const std::vector<std::size_t> keyframes = atlas.main_keyframes();
  Adjusted adjusted{.keyframes = static_cast<int>(keyframes.size())};
  if (keyframes.size() < 2) return adjusted;
  Bundle bundle = bundle_of(back_end, rig, clock_offset, keyframes, goes_on);
  Rounds rounds{.goes_on = goes_on};
  find_shutter(bundle, rig, adjusted, rounds);
  if (sought == Sought::readout_and_depth) find_correction(bundle, adjusted, rounds);
  if (!rounds.is_stopped) bundle.adjust(adjusted.has_readout, Bundle::Detail::fine, std::ref(rounds));
  adjusted.correction = bundle.correction();
  if (adjusted.has_readout) adjusted.readout = bundle.shutter().readout;
  adjusted.surfels = static_cast<int>(bundle.surfels());
  adjusted.observations = static_cast<int>(bundle.observations());
  adjusted.clock_offset = clock_offset + bundle.shutter().clock;
  for (std::size_t view = 0; view < keyframes.size(); ++view)
    atlas.world_from_camera[keyframes[view]] = bundle.world_from_view()[view];
  tell_uncertainty(bundle, atlas, keyframes, adjusted);
  return adjusted;
}

namespace {

Bundle with_cameras(Bundle bundle) {
  bundle.forget_ties();  // measured with cameras that may be wrong
  bundle.find_cameras(), bundle.find_correction();
  bundle.adjust(true, Bundle::Detail::coarse);
  return bundle;
}

}  // namespace

AdjustedCameras adjust_cameras(BackEnd& back_end, const Rig& rig, double clock_offset) {
  back_end.settle();
  const Atlas& atlas = back_end.atlas();
  const std::vector<std::size_t> keyframes =
      atlas.keyframes.empty() ? std::vector<std::size_t>{} : atlas.main_keyframes();
  AdjustedCameras found{.rig = rig, .clock_offset = clock_offset, .keyframes = static_cast<int>(keyframes.size())};
  if (keyframes.size() < kFewKeyframes) return found;
  Bundle told = bundle_of(back_end, rig, clock_offset, keyframes);
  Bundle bundle = with_cameras(told);
  told.forget_ties(), told.adjust(false, Bundle::Detail::coarse);
  found.predicts_better = predicts_better(bundle, told);
  found.rig = bundle.rig();
  found.rig.depth_correction = rig.depth_correction.then(bundle.correction());
  found.readout = bundle.shutter().readout, found.readout_sigma = bundle.readout_sigma();
  found.clock_offset = clock_offset + bundle.shutter().clock;
  return found;
}

double refocused_by(BackEnd& back_end, const Rig& rig, double clock_offset) {
  const std::vector<std::size_t> keyframes = back_end.atlas().main_keyframes();
  const auto middle = keyframes.begin() + static_cast<std::ptrdiff_t>(keyframes.size() / 2);
  const auto camera_of = [&](auto from, auto to) {
    return with_cameras(bundle_of(back_end, rig, clock_offset, {from, to})).rig().depth;
  };
  const Camera first = camera_of(keyframes.begin(), middle), second = camera_of(middle, keyframes.end());
  return (first.fx + first.fy) / (second.fx + second.fy) - 1;
}

}  // namespace cairn
