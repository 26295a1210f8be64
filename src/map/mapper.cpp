// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapper.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <optional>
#include <stdexcept>

#include "base/velocity.hpp"
#include "map/adjust.hpp"
#include "map/map_state.hpp"
#include "map/match.hpp"
#include "map/refine.hpp"
#include "map/second_pass.hpp"

namespace cairn {
namespace {

void tell(const CheckedFrame& checked, FrameReport& report) {
  report.cause = checked.cause();
  report.reason = checked.reason();
}

/// Covariance of the pose in the camera's frame. The alignment's information is in the frame of the predicted view.
Matrix6d covariance_of(const Tracked& tracked) {
  // Single-precision sums: unconstrained directions may have slightly negative eigenvalues.
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(tracked.alignment.information);
  const Matrix6d information =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).asDiagonal() * solver.eigenvectors().transpose();
  const Matrix6d in_view = (calibrated(information) + Matrix6d::Identity()).inverse();
  const Matrix6d camera_from_view = adjoint(tracked.submap_from_camera.inverse() * tracked.predicted_from);
  return camera_from_view * in_view * camera_from_view.transpose();
}

void tell(const Tracked& tracked, FrameReport& report) {
  const Alignment& a = tracked.alignment;
  report.guess = tracked.guess;
  report.fit = a.fit;
  if (tracked.state != Tracked::State::lost) report.tracked_from_camera = tracked.submap_from_camera;
  if (tracked.information() != nullptr) report.covariance = covariance_of(tracked);
  if (tracked.cause == FrameCause::none) return;
  report.cause = tracked.cause;
  report.reason = tracked.reason;
  if (tracked.state == Tracked::State::lost && tracked.cause != FrameCause::too_little_depth)
    report.state = FrameState::lost;
}

void tell(const Fused& fused, FrameReport& report) {
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
  tell(checked, report);
  s.tracker.listen(checked.frame().gyro);
  if (!checked.is_usable()) return report;

  Surface seen;
  const Tracked tracked = s.locate(checked.frame(), seen, report.stage_ms);
  tell(tracked, report);
  if (tracked.state == Tracked::State::lost) return report;
  if (given.held_out) {
    s.hold_out(given, tracked, report);
    return report;
  }
  if (tracked.cause == FrameCause::new_component) s.begin_component();

  if (s.is_colour_due(tracked)) seen.bring_colour();
  const Fused fused = timed(report.stage_ms, "fuse", [&] {
    return s.integrator.integrate(seen, tracked.submap_from_camera, s.volume, ++s.fused_count,
                                  s.look_every(s.motion(tracked)));
  });
  tell(fused, report);
  report.moving = s.tracker.moving();

  s.remember(checked.frame(), seen, tracked, report.stage_ms);
  s.follow(fused, report.stage_ms);
  return report;
}

void Mapper::begin_recording() {
  MapState& s = *state_;
  s.last_fused.reset();
  if (s.back_end.atlas().frames.empty()) return;
  s.end_everything();
  s.volume.adopt(s.back_end.world().release());
  s.back_end.begin_in_world();
  s.tracker.begin_lost();
  s.esdf.reset();
  for (GrowingSurface& surface : s.surfaces) surface = {};
}

void Mapper::settle() { state_->back_end.settle(); }

const Rig& Mapper::rig() const { return state_->rig; }

Upright Mapper::upright() const { return state_->upright(); }

void Mapper::settle_upright() {
  settle();
  state_->back_end.atlas().settle_upright();
}

Refined Mapper::refine(const std::function<bool(double)>& goes_on) {
  state_->whole.reset();
  Refined refined;
  state_->warnings().attempt("poses stay as they are", [&] { refined = cairn::refine(state_->back_end, goes_on); });
  return refined;
}

Adjusted Mapper::adjust(const std::function<bool(double)>& goes_on) {
  MapState& s = *state_;
  s.whole.reset();
  Adjusted adjusted;
  s.warnings().attempt("poses stay as they are", [&] {
    adjusted = cairn::adjust(s.back_end, s.rig, s.tracker.clock_offset(), Sought::readout_and_depth, goes_on);
  });
  return adjusted;
}

void Mapper::reintegrate(Source& again, const DepthCorrection& correction, const std::function<bool(int)>& goes_on) {
  MapState& s = *state_;
  int frames = 0;
  const auto go_on = [&] {
    if (goes_on && !goes_on(frames)) throw std::runtime_error(kEnded);
  };
  s.back_end.settle();
  s.whole.reset();
  const Volume::Residency residency = s.volume.residency();
  BrickTree before = s.volume.on_host().copy();
  const DepthCorrection known = s.rig.depth_correction;
  const bool is_done = s.warnings().attempt("frames are not fused again", [&] {
    if (recordings() > 1) throw std::runtime_error("the map is made of several recordings");
    check(correction);
    s.volume.adopt({});
    s.rig.depth_correction = s.rig.depth_correction.then(correction);
    const std::uint32_t since = s.fused_count + 1;
    std::optional<SecondPass> pass;
    if (s.is_tracked()) {
      pass.emplace(s.device, s.rig, s.preprocessor.camera(), s.options, s.back_end, correction,
                   s.tracker.clock_offset());
      pass->fuse_keyframes(s.integrator, s.volume, s.fused_count, go_on);
    }
    std::optional<Eigen::Isometry3d> last;
    while (const auto next = again.next()) {
      ++frames;
      go_on();
      const CheckedFrame checked(*next, s.rig, std::nullopt);
      if (!checked.is_usable()) continue;
      const Frame& frame = checked.frame();
      const auto given = pass ? std::nullopt : pose_at(s.given.poses, frame.timestamp, 0);
      if (!given && !(pass && pass->has(frame.timestamp))) continue;
      StageTimes ignored;
      const Surface seen =
          s.see(frame, pass ? pass->motion(frame.timestamp) : at_velocity(velocity_at(s.given.poses, frame.timestamp)),
                ignored);
      const Eigen::Isometry3d pose = pass ? pass->track(frame, seen, s.volume) : *given;
      if (frame.held_out || (pass && pass->is_keyframe(frame.timestamp))) continue;  // keyframes are already fused
      seen.bring_colour();
      const auto motion = last ? std::optional<Eigen::Isometry3d>(last->inverse() * pose) : std::nullopt;
      (void)s.integrator.integrate(seen, pose, s.volume, ++s.fused_count, s.look_every(motion));
      last = pose;
    }
    if (s.is_tracked()) s.back_end.rebase(since, pass->poses(), correction);
  });
  if (is_done) return;
  s.rig.depth_correction = known;
  s.volume.restore(std::move(before), residency);
}

std::shared_ptr<const DistanceField> Mapper::live_distances() const { return state_->live_distances.get(); }

Trajectory Mapper::trajectory(int recording) const { return state_->trajectory(recording); }

int Mapper::recordings() const { return state_->recordings(); }

Trajectory Mapper::path(std::size_t points) const {
  const MapState& s = *state_;
  const Atlas& atlas = s.back_end.atlas();
  const auto step_of = [&](std::size_t frames) { return frames / std::max<std::size_t>(1, points - 1) + 1; };
  Trajectory path;
  if (s.is_tracked()) {
    const std::size_t begin = atlas.recordings.empty() ? 0 : atlas.recordings.back(), end = atlas.frames.size();
    path = atlas.trajectory(atlas.main_component(), begin, end, step_of(end - begin));
    for (StampedPose& pose : path) pose.timestamp += s.tracker.clock_offset();
  } else if (const Trajectory& given = s.given.poses; !given.empty()) {
    for (std::size_t i = 0; i + 1 < given.size(); i += step_of(given.size())) path.push_back(given[i]);
    path.push_back(given.back());
  }
  return path;
}

std::vector<std::pair<double, int>> Mapper::keyframes() const {
  std::vector<std::pair<double, int>> keyframes;
  for (const Keyframe& keyframe : state_->back_end.atlas().keyframes)
    keyframes.emplace_back(keyframe.timestamp, static_cast<int>(keyframe.searched));
  return keyframes;
}

std::vector<FoundLoop> Mapper::loops() const {
  const Atlas& atlas = state_->back_end.atlas();
  std::vector<FoundLoop> loops;
  for (const Loop& loop : atlas.loops)
    if (loop.corners > 0)
      loops.push_back({.from = atlas.keyframes[loop.edge.i].timestamp,
                       .to = atlas.keyframes[loop.edge.j].timestamp,
                       .i_from_j = loop.edge.i_from_j,
                       .corners = loop.corners,
                       .inlier_share = loop.inlier_share,
                       .rmse = loop.rmse,
                       .inlier = loop.inlier});
  return loops;
}

Statistics Mapper::statistics() const { return state_->statistics(); }

const std::vector<std::string>& Mapper::warnings() const { return state_->warnings().all(); }

}  // namespace cairn
