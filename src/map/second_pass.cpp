// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/second_pass.hpp"

#include <algorithm>

#include "base/velocity.hpp"
#include "map/match.hpp"
#include "map/tracking_criteria.hpp"

namespace cairn {
namespace {

constexpr double kFarthest = 0.15;  // rad, m: max. distance of a frame's pose from the interpolated keyframe poses

/// Weight of the motion measured by an alignment, relative to the pose from the adjusted keyframes: positive part of
/// the estimator of James & Stein 1961, since motion below the alignment's error is noise. The information is for two
/// aligned views; its variance is halved, as the map averages many.
double told_share(const Vector6d& moved, const Matrix6d& information) {
  constexpr double kDimensions = 6, kOneOfTwo = 2;
  const double squared = kOneOfTwo * moved.dot(calibrated(information) * moved);
  return squared > kDimensions - 2 ? 1 - (kDimensions - 2) / squared : 0;
}

bool is_before(const StampedPose& pose, double timestamp) { return pose.timestamp < timestamp; }

}  // namespace

SecondPass::SecondPass(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
                       const BackEnd& back_end, const DepthCorrection& correction, double clock_offset)
    : back_end_(back_end),
      correction_(correction),
      clock_offset_(clock_offset),
      keyframes_(back_end.atlas().main_keyframes()),
      adjusted_(back_end.atlas().trajectory(back_end.atlas().main_component(), 0, back_end.atlas().frames.size())),
      poses_(adjusted_),
      preprocessor_(device, at_one_moment(rig), options.surface, options.track.levels, options.track.finest_level),
      raycaster_(device, rectified, options.surface, options.track.levels, options.track.finest_level),
      aligner_(device, options.track, rig.sensor),
      reference_(device, rectified, options.track) {}

void SecondPass::fuse_keyframes(Integrator& integrator, Volume& volume, std::uint32_t& fused_count,
                                const std::function<void()>& go_on) {
  const Atlas& atlas = back_end_.atlas();
  for (const std::size_t k : keyframes_) {
    go_on();
    Frame frame = back_end_.images().get(k);
    frame.colour_delay = atlas.keyframes[k].colour_delay;
    correction_.apply(back_end_.camera().width, back_end_.camera().height, frame.depth);
    const Surface seen = preprocessor_.preprocess(frame);
    seen.bring_colour();
    (void)integrator.integrate(seen, atlas.world_from_camera[k], volume, ++fused_count, 1);
  }
}

std::optional<std::size_t> SecondPass::index_of(double timestamp) const {
  const auto found = std::lower_bound(poses_.begin(), poses_.end(), timestamp, is_before);
  if (found == poses_.end() || found->timestamp != timestamp) return std::nullopt;
  return static_cast<std::size_t>(found - poses_.begin());
}

MotionAt SecondPass::motion(double timestamp) const { return at_velocity(velocity_at(adjusted_, timestamp)); }

bool SecondPass::is_keyframe(double timestamp) const {
  const auto& all = back_end_.atlas().keyframes;
  const auto found = std::lower_bound(keyframes_.begin(), keyframes_.end(), timestamp,
                                      [&](std::size_t k, double time) { return all[k].timestamp < time; });
  return found != keyframes_.end() && all[*found].timestamp == timestamp;
}

Eigen::Isometry3d SecondPass::track(const Frame& frame, const Surface& live, Volume& volume) {
  Eigen::Isometry3d& pose = poses_[*index_of(frame.timestamp)].world_from_camera;
  const ColourMoment moment{.velocity = velocity_at(adjusted_, frame.timestamp),
                            .stamp_delay = frame.colour_delay,
                            .clock_offset = clock_offset_};
  if (is_keyframe(frame.timestamp)) {
    if (!live.packed.empty()) reference_.set(live, pose, moment);
    return pose;
  }
  volume.bring(pose.translation());
  const SurfacePrediction view = raycaster_.raycast(volume, pose);
  const Alignment a = aligner_.align(live, view, pose, &reference_, moment);
  const Vector6d moved = local_coordinates(pose.inverse() * a.submap_from_camera);
  const bool is_trusted =
      a.converged() && misfit(a) <= kMisfit && moved.head<3>().norm() < kFarthest && moved.tail<3>().norm() < kFarthest;
  if (is_trusted) pose = pose * retract(told_share(moved, a.information) * moved);
  if (!frame.held_out && !live.packed.empty() &&
      (!reference_.is_set() || is_new_reference(reference_.submap_from_camera(), pose, &a)))
    reference_.set(live, pose, moment);
  return pose;
}

}  // namespace cairn
