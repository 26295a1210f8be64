// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/mapper.hpp"

#include "mapper/adjust.hpp"
#include "mapper/frame_report.hpp"
#include "mapper/map_state.hpp"
#include "mapper/refine.hpp"
#include "mapper/second_pass.hpp"

namespace cairn {
namespace {

void fill(const IntegrationResult& fused, FrameReport& report) {
  report.state = FrameState::fused;
  report.touched_bricks = fused.touched;
  report.new_bricks = fused.new_bricks;
}

std::shared_ptr<MapState> make_state(const Rig& rig, const Options& options, Poses poses, int device) {
  check(rig);
  check(options);
  if (options.esdf.live) (void)esdf_scale(options.fuse, options.esdf);
  return std::make_shared<MapState>(rig, options, poses, device);
}

}  // namespace

Mapper::Mapper(const Rig& rig, const Options& options, Poses poses, int device)
    : state_(make_state(rig, options, poses, device)) {}

Mapper::Mapper(std::shared_ptr<MapState> state) : state_(std::move(state)) {}

FrameReport Mapper::add(const Frame& given) {
  MapState& s = *state_;
  FrameReport report{.index = given.index, .timestamp = given.timestamp};
  const CheckedFrame checked = s.check(given);
  fill(checked, report);
  s.tracker.add_inertial(checked.frame());
  if (!checked.is_usable()) return report;

  FramePyramid seen;
  const TrackingResult tracked = s.track(checked.frame(), seen, report.stage_ms);
  fill(tracked, report);
  if (tracked.state == TrackingResult::State::lost) return report;
  if (given.held_out) {
    s.hold_out(given, seen, tracked, report);
    return report;
  }
  if (tracked.cause == FrameCause::new_component) s.begin_component();

  if (s.is_color_due(tracked)) seen.register_color_to_depth();
  const IntegrationResult fused = timed(report.stage_ms, "fuse", [&] {
    return s.integrator.integrate(seen, tracked.submap_from_camera, s.volume, ++s.fused_count,
                                  s.carving_interval(s.motion(tracked)));
  });
  fill(fused, report);
  report.moving = s.tracker.moving();

  s.commit_frame(checked.frame(), seen, tracked, report.stage_ms);
  s.update_esdf_and_mesh(fused, report.stage_ms);
  return report;
}

void Mapper::begin_recording() {
  MapState& s = *state_;
  s.last_fused.reset();
  if (s.back_end.atlas().frames.empty()) return;
  s.end_map();
  s.volume.adopt(s.back_end.global_volume().release());
  s.back_end.begin_recording();
  s.tracker.start_lost();
  s.esdf.reset();
  for (IncrementalMesher& surface : s.surfaces) surface = {};
}

void Mapper::finish_optimization() { state_->back_end.finish_optimization(); }

const Rig& Mapper::rig() const { return state_->rig; }

GravityAlignment Mapper::upright() const { return state_->upright(); }

void Mapper::freeze_gravity() {
  finish_optimization();
  state_->back_end.atlas().freeze_gravity();
}

RefineReport Mapper::refine(const std::function<bool(double)>& progress) {
  state_->cached_volume.reset();
  RefineReport refined;
  state_->warnings().attempt("poses stay unchanged", [&] { refined = cairn::refine(state_->back_end, progress); });
  return refined;
}

AdjustReport Mapper::adjust(const std::function<bool(double)>& progress) {
  MapState& s = *state_;
  s.cached_volume.reset();
  AdjustReport adjusted;
  s.warnings().attempt("poses stay unchanged", [&] {
    adjusted =
        cairn::adjust(s.back_end, s.rig, s.tracker.clock_offset(), AdjustedParameters::readout_and_depth, progress);
  });
  return adjusted;
}

void Mapper::reintegrate(Source& source, const DepthCorrection& correction, const std::function<bool(int)>& progress) {
  (void)cairn::reintegrate(*state_, source, {.added = {.correction = correction}}, progress);
}

std::shared_ptr<const DistanceField> Mapper::live_distances() const { return state_->live_distances.get(); }

Trajectory Mapper::trajectory(int recording) const { return state_->trajectory(recording); }

int Mapper::recordings() const { return state_->recordings(); }

Trajectory Mapper::path(std::size_t points) const { return state_->path(points); }

std::vector<KeyframeInfo> Mapper::keyframes() const {
  std::vector<KeyframeInfo> keyframes;
  for (const Keyframe& keyframe : state_->back_end.atlas().keyframes)
    keyframes.push_back({.timestamp = keyframe.timestamp, .searched = static_cast<int>(keyframe.searched)});
  return keyframes;
}

std::vector<FoundLoop> Mapper::loops() const {
  const Atlas& atlas = state_->back_end.atlas();
  std::vector<FoundLoop> loops;
  for (const Loop& loop : atlas.loops)
    if (loop.feature_inliers > 0)
      loops.push_back({.from = atlas.keyframes[loop.edge.i].timestamp,
                       .to = atlas.keyframes[loop.edge.j].timestamp,
                       .i_from_j = loop.edge.i_from_j,
                       .feature_inliers = loop.feature_inliers,
                       .inlier_share = loop.inlier_share,
                       .rmse = loop.rmse,
                       .inlier = loop.inlier});
  return loops;
}

Statistics Mapper::statistics() const { return state_->statistics(); }

const std::vector<std::string>& Mapper::warnings() const { return state_->warnings().all(); }

}  // namespace cairn
