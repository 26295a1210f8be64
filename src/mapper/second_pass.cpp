// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/second_pass.hpp"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>
#include <vector>

#include "alignment/align.hpp"
#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "geometry/readout.hpp"
#include "geometry/velocity.hpp"
#include "graph/inflate_information.hpp"
#include "mapper/adjust.hpp"
#include "mapper/back_end.hpp"
#include "mapper/refine.hpp"
#include "mapper/tracking_criteria.hpp"
#include "preprocess/preprocess.hpp"
#include "preprocess/rectify.hpp"
#include "volume/integrate.hpp"
#include "volume/raycast.hpp"

namespace cairn {
namespace {

constexpr double kMaxMotion = 0.15;  // rad, m: max. distance of a frame's pose from the interpolated keyframe poses
// Share of the image's width: max. view change since the last tracked frame for an interpolated pose.
constexpr double kMaxInterpolatedChange = 0.05;

/// Weight of the motion measured by an alignment, relative to the pose from the adjusted keyframes: positive part of
/// the estimator of James & Stein 1961, since motion below the alignment's error is noise. The information is for two
/// aligned views; its variance is halved, as the map averages many.
double motion_weight(const Vector6d& moved, const Matrix6d& information) {
  constexpr double kDimensions = 6, kVarianceRatio = 2;
  const double squared = kVarianceRatio * moved.dot(inflate_information(information) * moved);
  return squared > kDimensions - 2 ? 1 - (kDimensions - 2) / squared : 0;
}

/// Motion of an alignment from the pose of the adjusted keyframes.
Vector6d motion_of(const Alignment& a, const Eigen::Isometry3d& pose) {
  return local_coordinates(pose.inverse() * a.submap_from_camera);
}

bool is_trusted(const Alignment& a, const Eigen::Isometry3d& pose) {
  const Vector6d moved = motion_of(a, pose);
  return a.converged() && misfit(a) <= kMaxMisfit && moved.head<3>().norm() < kMaxMotion &&
         moved.tail<3>().norm() < kMaxMotion;
}

bool is_before(const StampedPose& pose, double timestamp) { return pose.timestamp < timestamp; }

/// Second pass over tracked poses.
class SecondPass {
 public:
  /// `rectified`: camera of the surfaces. `added`: to the calibration of the stored keyframes.
  SecondPass(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options, BackEnd& back_end,
             const AddedCalibration& added, double clock_offset);

  /// Fuses the keyframes at their adjusted poses. `check_canceled` is called before each, and may throw.
  void fuse_keyframes(Integrator& integrator, Volume& volume, std::uint32_t& fused_count,
                      const std::function<void()>& check_canceled);
  /// True if the first pass fused or held out a frame with this timestamp, in the main component.
  [[nodiscard]] bool has(double timestamp) const { return index_of(timestamp).has_value(); }
  /// Motion of the camera at a frame's time, from the adjusted keyframes.
  [[nodiscard]] MotionAt motion(double timestamp) const;
  [[nodiscard]] bool is_keyframe(double timestamp) const;
  /// True if the view has hardly changed since the last tracked frame, of which it is at most the `max_count`-th
  /// successor.
  [[nodiscard]] bool is_interpolated(const Frame& frame, int max_count) const;
  /// Tracks the frame again and returns its pose; the adjusted pose if the alignment is unreliable or the frame is a
  /// keyframe.
  [[nodiscard]] Eigen::Isometry3d track(const Frame& frame, const FramePyramid& live, Volume& volume);
  /// Interpolates the corrections of adjusted poses between the last two tracked frames.
  [[nodiscard]] Eigen::Isometry3d interpolate(double timestamp);
  /// Poses of all frames of the main component, updated by track() and interpolate().
  [[nodiscard]] const Trajectory& poses() const { return poses_; }
  /// Stores these poses, see BackEnd::rebase.
  void rebase(std::uint32_t since);

 private:
  [[nodiscard]] Frame stored_keyframe(std::size_t keyframe) const;
  /// Corrects the images of a keyframe for an added readout.
  [[nodiscard]] Frame without_shutter(const Frame& frame, std::size_t keyframe);
  [[nodiscard]] std::optional<std::size_t> index_of(double timestamp) const;
  [[nodiscard]] Vector6d correction_of(std::size_t frame) const {
    return local_coordinates(adjusted_[frame].world_from_camera.inverse() * poses_[frame].world_from_camera);
  }

  BackEnd& back_end_;
  DepthCorrection correction_;
  std::optional<GlobalShutter> global_shutter_;  // for an added readout
  double clock_offset_;
  std::vector<std::size_t> keyframes_;            // of the main component
  Trajectory adjusted_, poses_;                   // before and after tracking
  std::size_t tracked_before_ = 0, tracked_ = 0;  // last two tracked frames
  Preprocessor preprocessor_;                     // of keyframes, already corrected for the shutter
  Raycaster raycaster_;
  Aligner aligner_;
  PhotometricKeyframe reference_;
  SurfacePrediction prediction_;
  int frames_of_prediction_ = 0;
};

SecondPass::SecondPass(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
                       BackEnd& back_end, const AddedCalibration& added, double clock_offset)
    : back_end_(back_end),
      correction_(added.correction),
      clock_offset_(clock_offset),
      keyframes_(back_end.atlas().main_keyframes()),
      adjusted_(back_end.atlas().trajectory(back_end.atlas().main_component(), 0, back_end.atlas().frames.size())),
      poses_(adjusted_),
      preprocessor_(device, with_global_shutter(rig), options.surface, options.track.levels,
                    options.track.finest_level),
      raycaster_(device, rectified, options.surface, options.track.levels, options.track.finest_level),
      aligner_(device, options.track, rig.sensor),
      reference_(device, rectified, options.track) {
  if (added.readout > 0) global_shutter_.emplace(device, rig);
}

Frame SecondPass::stored_keyframe(std::size_t keyframe) const {
  Frame frame = back_end_.images().get(keyframe);
  frame.color_delay = back_end_.atlas().keyframes[keyframe].color_delay;
  return frame;
}

Frame SecondPass::without_shutter(const Frame& frame, std::size_t keyframe) {
  return global_shutter_ ? (*global_shutter_)(frame, motion(back_end_.atlas().keyframes[keyframe].timestamp)) : frame;
}

void SecondPass::rebase(std::uint32_t since) {
  back_end_.rebase(since, poses_, correction_);
  if (!global_shutter_) return;
  for (std::size_t k = 0; k < back_end_.atlas().keyframes.size(); ++k)
    back_end_.replace_images(k, without_shutter(stored_keyframe(k), k));
}

void SecondPass::fuse_keyframes(Integrator& integrator, Volume& volume, std::uint32_t& fused_count,
                                const std::function<void()>& check_canceled) {
  const Atlas& atlas = back_end_.atlas();
  for (const std::size_t k : keyframes_) {
    check_canceled();
    Frame frame = stored_keyframe(k);
    correction_.apply(back_end_.camera().width, back_end_.camera().height, frame.depth);
    frame = without_shutter(frame, k);
    const FramePyramid seen = preprocessor_.preprocess(frame);
    seen.register_color_to_depth();
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

bool SecondPass::is_interpolated(const Frame& frame, int max_count) const {
  const std::size_t i = *index_of(frame.timestamp);
  if (frame.held_out || i == 0 || i + 1 == poses_.size() || is_keyframe(frame.timestamp)) return false;
  return i <= tracked_ + static_cast<std::size_t>(max_count) &&
         view_change(back_end_.camera(), adjusted_[tracked_].world_from_camera.inverse() *
                                             adjusted_[i].world_from_camera) < kMaxInterpolatedChange;
}

Eigen::Isometry3d SecondPass::interpolate(double timestamp) {
  const std::size_t i = *index_of(timestamp);
  const double begin = poses_[tracked_before_].timestamp, duration = poses_[tracked_].timestamp - begin;
  const double share = duration > 0 ? (timestamp - begin) / duration : 0;
  const Vector6d correction = (1 - share) * correction_of(tracked_before_) + share * correction_of(tracked_);
  return poses_[i].world_from_camera = adjusted_[i].world_from_camera * retract(correction);
}

Eigen::Isometry3d SecondPass::track(const Frame& frame, const FramePyramid& live, Volume& volume) {
  const std::size_t index = *index_of(frame.timestamp);
  tracked_before_ = std::exchange(tracked_, index);
  Eigen::Isometry3d& pose = poses_[index].world_from_camera;
  const ColorMoment moment{.velocity = velocity_at(adjusted_, frame.timestamp),
                           .stamp_delay = frame.color_delay,
                           .clock_offset = clock_offset_};
  if (is_keyframe(frame.timestamp)) {
    if (!live.packed.empty()) reference_.set(live, pose, moment);
    return pose;
  }
  volume.page_in_around(pose.translation());
  const bool is_reused = !prediction_.levels.empty() &&
                         is_prediction_reusable(back_end_.camera(), prediction_.submap_from_camera.inverse() * pose,
                                                frames_of_prediction_);
  const auto predict = [&] { prediction_ = raycaster_.raycast(volume, pose), frames_of_prediction_ = 0; };
  if (!is_reused) predict();
  Alignment a = aligner_.align(live, prediction_, pose, &reference_, moment);
  if (is_reused && !is_trusted(a, pose)) {
    predict();
    a = aligner_.align(live, prediction_, pose, &reference_, moment);
  }
  ++frames_of_prediction_;
  if (is_trusted(a, pose)) {
    const Vector6d moved = motion_of(a, pose);
    pose = pose * retract(motion_weight(moved, a.information) * moved);
  }
  if (!frame.held_out && !live.packed.empty() &&
      (!reference_.is_set() || is_new_reference(reference_.submap_from_camera(), pose, &a)))
    reference_.set(live, pose, moment);
  return pose;
}

/// Second pass over given poses, which do not change. The keyframes serve only for textures.
class GivenPass {
 public:
  explicit GivenPass(const Trajectory& poses) : poses_(poses) {}

  [[nodiscard]] bool has(double timestamp) const { return pose_at(poses_, timestamp, 0).has_value(); }
  [[nodiscard]] MotionAt motion(double timestamp) const { return at_velocity(velocity_at(poses_, timestamp)); }
  [[nodiscard]] static bool is_keyframe(double) { return false; }
  [[nodiscard]] static bool is_interpolated(const Frame&, int) { return false; }
  [[nodiscard]] Eigen::Isometry3d interpolate(double timestamp) const { return *pose_at(poses_, timestamp, 0); }
  [[nodiscard]] const Trajectory& poses() const { return poses_; }
  [[nodiscard]] Eigen::Isometry3d track(const Frame& frame, const FramePyramid&, Volume&) const {
    return *pose_at(poses_, frame.timestamp, 0);
  }

 private:
  const Trajectory& poses_;
};

/// Frames of a source, with their count; each may be canceled.
struct CountedFrames {
  Source& source;
  const std::function<bool(int)>& progress;
  int count = 0;

  void check_canceled() const {
    if (progress && !progress(count)) throw std::runtime_error(kInterrupted);
  }
  [[nodiscard]] std::optional<Frame> next() {
    auto frame = source.next();
    if (!frame) return frame;
    ++count;
    check_canceled();
    return frame;
  }
};

/// Fuses the frames of a second pass.
template <class Pass>
class PassFrames {
 public:
  PassFrames(MapState& state, Pass& pass, const SecondPassOptions& options)
      : s_(state), pass_(pass), options_(options) {}

  /// Fuses all frames with a pose, except keyframes and held-out frames.
  void fuse(CountedFrames& frames) {
    while (const auto read = frames.next()) {
      const CheckedFrame checked(*read, s_.rig, std::nullopt);
      if (!checked.is_usable() || !pass_.has(checked.frame().timestamp)) continue;
      if (read->held_out && options_.keeps_held_out) held_out_.push_back(*read);
      const Frame& frame = checked.frame();
      if (pass_.is_interpolated(frame, options_.max_interpolated)) {
        waiting_.push_back(frame);
        continue;
      }
      track(frame);
      fuse_waiting();
    }
    fuse_waiting();
  }
  [[nodiscard]] std::vector<Frame> take_held_out() { return std::move(held_out_); }

 private:
  [[nodiscard]] FramePyramid preprocess(const Frame& frame) {
    return s_.preprocessor->preprocess(frame, pass_.motion(frame.timestamp));
  }
  void track(const Frame& frame) {
    const FramePyramid seen = preprocess(frame);
    const Eigen::Isometry3d pose = pass_.track(frame, seen, s_.volume);
    if (frame.held_out || pass_.is_keyframe(frame.timestamp)) return;  // keyframes are already fused
    const auto motion = last_ ? std::optional<Eigen::Isometry3d>(last_->inverse() * pose) : std::nullopt;
    fuse(seen, pose, s_.carving_interval(motion));
    last_ = pose;
  }
  /// Fuses every second frame between the last two tracked ones. Their views hardly differ: they need no color that has
  /// to be registered, and carve nothing new.
  void fuse_waiting() {
    for (std::size_t i = 0; i < waiting_.size(); ++i) {
      const Frame& frame = waiting_[i];
      const Eigen::Isometry3d pose = pass_.interpolate(frame.timestamp);
      if (i % 2 == 0)
        fuse(s_.preprocessor->preprocess_for_fusion(frame, pass_.motion(frame.timestamp)), pose,
             Integrator::kCarvingInterval);
    }
    waiting_.clear();
  }
  void fuse(const FramePyramid& seen, const Eigen::Isometry3d& pose, std::uint32_t carving_interval) {
    seen.register_color_to_depth();
    (void)s_.integrator.integrate(seen, pose, s_.volume, ++s_.fused_count, carving_interval);
  }

  MapState& s_;
  Pass& pass_;
  const SecondPassOptions& options_;
  std::vector<Frame> waiting_;             // since the last tracked frame
  std::vector<Frame> held_out_;            // as read
  std::optional<Eigen::Isometry3d> last_;  // pose of the last tracked and fused frame
};

/// Compares the new map with the held-out frames. Returns false if they do not confirm it.
[[nodiscard]] bool is_accepted(MapState& s, const Trajectory& poses, const SecondPassOptions& options,
                               SecondPassResult& result) {
  if (options.before == nullptr) return true;
  result.error = s.held_out.compare(s.volume.on_host(), s.options.fuse, options.added, poses);
  return !result.error || is_confirmed(*options.before, *result.error);
}

/// Returns false if the new map is discarded.
bool fuse_again(MapState& s, const TrackedPoses&, CountedFrames& frames, const SecondPassOptions& options,
                SecondPassResult& result) {
  const std::uint32_t since = s.fused_count + 1;
  SecondPass pass(s.device, s.rig, s.preprocessor->camera(), s.options, s.back_end, options.added,
                  s.tracker.clock_offset());
  pass.fuse_keyframes(s.integrator, s.volume, s.fused_count, [&] { frames.check_canceled(); });
  PassFrames all(s, pass, options);
  all.fuse(frames);
  result.held_out = all.take_held_out();
  if (!is_accepted(s, pass.poses(), options, result)) return false;
  pass.rebase(since);
  return true;
}

bool fuse_again(MapState& s, const GivenPoses& given, CountedFrames& frames, const SecondPassOptions& options,
                SecondPassResult&) {
  GivenPass pass(given.poses());
  PassFrames(s, pass, options).fuse(frames);
  return true;
}

Rig with_calibration(Rig rig, const AddedCalibration& added) {
  check(added.correction);
  if (added.readout > 0 && is_rolling(rig)) throw std::runtime_error("the cameras already have a readout");
  if (added.readout > 0) rig = with_readout(std::move(rig), added.readout);
  rig.depth_correction = rig.depth_correction.compose(added.correction);
  check(rig);
  return rig;
}

}  // namespace

SecondPassResult reintegrate(MapState& s, Source& source, const SecondPassOptions& options,
                             const std::function<bool(int)>& progress) {
  s.back_end.finish_optimization();
  s.cached_volume.reset();
  const Volume::SavedState saved_volume = s.volume.save();
  BrickTree before = s.volume.on_host().copy();
  const Rig known = s.rig;
  SecondPassResult result;
  const bool is_done = s.warnings().attempt("frames are not re-integrated", [&] {
    if (s.recordings() > 1) throw std::runtime_error("the map has several recordings");
    s.set_rig(with_calibration(known, options.added));
    s.volume.adopt({});
    CountedFrames frames{source, progress};
    result.is_replaced =
        std::visit([&](const auto& poses) { return fuse_again(s, poses, frames, options, result); }, s.poses);
  });
  if (is_done && result.is_replaced) return result;
  s.set_rig(known);
  s.volume.restore(std::move(before), saved_volume);
  return {.error = result.error, .held_out = std::move(result.held_out)};
}

void fuse_held_out(MapState& s, const std::vector<Frame>& frames) {
  const Atlas& atlas = s.back_end.atlas();
  const Trajectory poses = atlas.trajectory(atlas.main_component(), 0, atlas.frames.size());
  for (const Frame& given : frames) {
    const CheckedFrame checked(given, s.rig, std::nullopt);  // with the depth correction of this map
    const Frame& frame = checked.frame();
    const auto pose = pose_at(poses, frame.timestamp, 0);
    if (!pose) continue;
    const FramePyramid seen = s.preprocessor->preprocess(frame, at_velocity(velocity_at(poses, frame.timestamp)));
    seen.register_color_to_depth();
    (void)s.integrator.integrate(seen, *pose, s.volume, ++s.fused_count);
  }
}

}  // namespace cairn
