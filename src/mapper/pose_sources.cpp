// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/pose_sources.hpp"

#include <algorithm>

#include "geometry/readout.hpp"
#include "mapper/tracking_criteria.hpp"
#include "preprocess/rectify.hpp"

namespace cairn {
namespace {

constexpr double kMaxShutterError = 4.0;  // max. row error without preprocessing again

FramePyramid preprocess(Preprocessor& preprocessor, const Frame& frame, const MotionAt& motion, StageTimes& times) {
  return timed(times, "preprocess", [&] { return preprocessor.preprocess(frame, motion); });
}

/// Sampling interval that leaves at most `points` of `frames`.
std::size_t path_step(std::size_t frames, std::size_t points) {
  return frames / std::max<std::size_t>(1, points - 1) + 1;
}

}  // namespace

void TrackedPoses::check(const Frame& frame, CheckedFrame& checked) {
  if (checked.is_usable() && !frame.held_out && repeats_.is_stuck(frame)) checked.reject(FrameCause::stuck);
}

/// The rolling shutter correction uses a predicted motion. Alignment accounts for a different motion. At a significant
/// difference the fusion image is corrected again, and the whole pyramid of a photometric reference.
TrackingResult TrackedPoses::track(const Frame& frame, FramePyramid& seen, StageTimes& times) {
  const MotionAt predicted_motion = tracker_.motion(frame);
  seen = preprocess(preprocessor_, frame, predicted_motion, times);
  if (frame.held_out) return tracker_.track_only(frame, seen, volume_, times);
  TrackingResult tracked = tracker_.track(frame, seen, volume_, times);
  if (!is_rolling(rig_) || tracked.state != TrackingResult::State::aligned) return tracked;
  const MotionAt measured_motion = tracker_.motion(frame, tracked.submap_from_camera);
  if (shutter_difference(rig_, predicted_motion, measured_motion) < kMaxShutterError) return tracked;
  if (tracker_.is_reference_due(seen, tracked))
    seen = preprocess(preprocessor_, frame, measured_motion, times);
  else
    timed(times, "preprocess", [&] { preprocessor_.correct_fusion(seen, frame, measured_motion); });
  tracker_.mask_moving(seen, tracked, volume_);
  return tracked;
}

std::optional<Eigen::Isometry3d> TrackedPoses::last() const {
  const auto& last = tracker_.state().last;
  return last.empty() ? std::nullopt : std::optional(last.back().submap_from_camera);
}

void TrackedPoses::commit(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked,
                          std::uint32_t fused_count, StageTimes& times) {
  tracker_.commit(frame, live, tracked);
  if (const std::string text = tracker_.inertial_contradiction(); !text.empty()) back_end_.warnings().add(text);
  const bool is_keyframe = timed(times, "keyframe", [&] {
    const OtherSensors sensors{.drift = tracker_.device_drift(),
                               .inertial = [&] { return tracker_.take_inertial_keyframe(); },
                               .mount = tracker_.inertial().mount(),
                               .is_inertial_contradicted = tracker_.inertial().is_contradicted(),
                               .before_break = tracked.before_break};
    return back_end_.add(frame, live, tracked.submap_from_camera, tracked.information(), sensors, volume_, fused_count);
  });
  if (is_keyframe)
    back_end_.warnings().attempt("the focal length is not checked", [&] { tracker_.add_focal_evidence(); });
}

bool TrackedPoses::hold_out(const Frame& frame, const TrackingResult& tracked) {
  return back_end_.hold_out(frame.timestamp, tracked.submap_from_camera);
}

Trajectory TrackedPoses::trajectory(int recording) const {
  const Atlas& atlas = back_end_.atlas();
  const std::size_t number = recording < 0 ? atlas.recordings.size() : static_cast<std::size_t>(recording);
  const std::size_t begin = number == 0 ? 0 : atlas.recordings.at(number - 1);
  const std::size_t end = number < atlas.recordings.size() ? atlas.recordings[number] : atlas.frames.size();
  Trajectory trajectory = atlas.trajectory(atlas.main_component(), begin, end);
  for (StampedPose& pose : trajectory) pose.timestamp += tracker_.clock_offset();
  return trajectory;
}

Trajectory TrackedPoses::path(std::size_t points) const {
  const Atlas& atlas = back_end_.atlas();
  const std::size_t begin = atlas.recordings.empty() ? 0 : atlas.recordings.back(), end = atlas.frames.size();
  Trajectory path = atlas.trajectory(atlas.main_component(), begin, end, path_step(end - begin, points));
  for (StampedPose& pose : path) pose.timestamp += tracker_.clock_offset();
  return path;
}

TrackingResult GivenPoses::track(const Frame& frame, FramePyramid& seen, StageTimes& times) {
  Vector6d velocity = Vector6d::Zero();
  if (is_rolling(rig_) && !poses_.empty())
    velocity = local_coordinates(poses_.back().world_from_camera.inverse() * *frame.world_from_camera) /
               (frame.timestamp - poses_.back().timestamp);
  seen = preprocess(preprocessor_, frame, at_velocity(velocity), times);
  return {.state = TrackingResult::State::initialized, .submap_from_camera = *frame.world_from_camera};
}

std::optional<Eigen::Isometry3d> GivenPoses::last() const {
  return poses_.empty() ? std::nullopt : std::optional(poses_.back().world_from_camera);
}

void GivenPoses::commit(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked, std::uint32_t,
                        StageTimes&) {
  add_keyframe(frame, live);
  add_gravity_evidence(frame, live);
  poses_.push_back({frame.timestamp, tracked.submap_from_camera});
}

bool GivenPoses::hold_out(const Frame& frame, const TrackingResult& tracked) {
  poses_.push_back({frame.timestamp, tracked.submap_from_camera});
  return true;
}

void GivenPoses::add_keyframe(const Frame& frame, const FramePyramid& live) {
  if (!options_.keep_keyframes) return;
  if (!keyframes_.empty() &&
      !exceeds_keyframe_distance(poses_[keyframes_.back().pose].world_from_camera, *frame.world_from_camera))
    return;
  images_.put(keyframes_.size(), live.images(), Features{});
  keyframes_.push_back({poses_.size(), frame.color_delay});
}

void GivenPoses::add_gravity_evidence(const Frame& frame, const FramePyramid& live) {
  const Eigen::Isometry3d& pose = *frame.world_from_camera;
  if (frame.acceleration)
    accelerations_ += (Eigen::Vector4d() << pose.linear() * *frame.acceleration, frame.acceleration->norm()).finished();
  if (views_.empty() || exceeds_keyframe_distance(poses_[views_.back().pose].world_from_camera, pose))
    views_.push_back({poses_.size(), back_end_.structure(live.images())});
}

GravityAlignment GivenPoses::upright() const {
  GravityEvidence evidence{.accelerations = accelerations_};
  if (!poses_.empty()) evidence.world_from_first_camera = poses_.front().world_from_camera.linear();
  for (const View& view : views_)
    evidence.views.push_back({poses_[view.pose].world_from_camera.linear(), &view.structure});
  if (!options_.up) return given_gravity_alignment(evidence);
  const auto down = estimate_gravity(evidence, *options_.up);
  return down ? gravity_alignment_of(*down, evidence) : unknown_gravity_alignment();
}

Trajectory GivenPoses::path(std::size_t points) const {
  Trajectory path;
  if (poses_.empty()) return path;
  for (std::size_t i = 0; i + 1 < poses_.size(); i += path_step(poses_.size(), points)) path.push_back(poses_[i]);
  path.push_back(poses_.back());
  return path;
}

}  // namespace cairn
