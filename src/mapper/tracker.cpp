// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/tracker.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/readout.hpp"
#include "mapper/frame_features.hpp"
#include "mapper/tracking_criteria.hpp"
#include "shaders/noise.h"
#include "spirv/moving_judge.comp.h"
#include "spirv/moving_mask.comp.h"

namespace cairn {
namespace {

constexpr int kClockOffsetFrames = 10;        // min. frames for a clock offset estimate
constexpr int kFocalPairs = 4;                // min. pairs of views for a focal length estimate
constexpr double kFocalTurn = 0.1;            // min. rotation in rad between the two views of a pair
constexpr double kClockOffsetContrast = 1.5;  // min. ratio of the worst to the best cost
// Keyframes to compare a frame with.
constexpr std::size_t kMaxRecentKeyframes = 4, kMaxSimilarKeyframes = 6, kMaxOtherKeyframes = 4;
constexpr std::size_t kMaxGuesses = 3;  // poses by features to align a lost frame at, with stored keyframes
constexpr double kMinRivalShare = 0.5;  // feature inliers of another place, relative to the found one
constexpr double kElsewhereDistance = 0.5, kElsewhereAngle = 0.35;  // m, rad: other place
constexpr double kMaxMoving = 0.3;                                  // share of the image
constexpr int kAllUnobserved = 6;                                   // unobserved directions of a pose without alignment
constexpr double kMaxGyroSeconds = 0.3;     // max. seconds of tracking by the inertial sensor alone
constexpr double kMaxInertialSigma = 0.05;  // m, of a prediction
constexpr double kInertialSigmas = 2.5;     // of a prediction confirmed by an alignment
constexpr double kCorrelatedPoints = 100;   // neighboring points that count as one
// Rad, m: sigma of an alignment with many points.
constexpr double kMinRotationSigma = 0.001, kMinTranslationSigma = 0.002;
// SensorModel::common_error from which a device is trusted before a comparison: alignments would bend the young map.
constexpr float kUncertainSensor = 1;
constexpr double kMaxDeviceSeconds = 3;  // max. seconds of tracking by device poses alone
// Rad, m: sigma of a pose by gyroscope alone.
constexpr double kGyroRotationSigma = 0.005, kGyroTranslationSigma = 0.02;
// Factor on a velocity that was itself weakly observed: hand motion reverses.
constexpr double kWeakVelocityFactor = 0.8;
constexpr int kMinGuesses = 5;                   // min. number to trust given guesses
constexpr double kMaxGuessError = 0.03;          // rad and m summed: max. error of a good guess from frame to frame
constexpr double kMotionFactors[] = {2, 0.5};    // on a wide predicted motion: a turn begins and ends within few frames
constexpr double kMaxExtrapolation = 0.5;        // max. seconds to extrapolate a velocity
constexpr double kMinComponentDepthShare = 0.2;  // share of the image with depth, to start a component
constexpr double kMinMapDepthShare = 0.02;  // share of the image with depth, to start the map; the alignment's minimum

/// Pose of the first camera in a world whose y axis points down.
Eigen::Isometry3d level(const std::optional<Eigen::Vector3d>& acceleration) {
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  if (acceleration && acceleration->norm() > 0)
    world_from_camera.linear() =
        Eigen::Quaterniond::FromTwoVectors(*acceleration, -Eigen::Vector3d::UnitY()).toRotationMatrix();
  return world_from_camera;
}

std::uint64_t pixels_of(const Camera& camera) { return static_cast<std::uint64_t>(camera.width * camera.height); }

/// Max. number of moving pixels. A larger number indicates a wrong pose or an unusable sensor rather than a person.
std::uint32_t max_moving_pixels(const Camera& camera) {
  return static_cast<std::uint32_t>(kMaxMoving * static_cast<double>(pixels_of(camera)));
}

/// Share of the depth image between two depths.
double share_between(const std::vector<float>& depth, float min_depth, float max_depth) {
  const auto seen =
      std::count_if(depth.begin(), depth.end(), [&](float z) { return z >= min_depth && z <= max_depth; });
  return static_cast<double>(seen) / static_cast<double>(depth.size());
}

bool is_elsewhere(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Isometry3d motion = a.inverse() * b;
  return motion.translation().norm() > kElsewhereDistance ||
         Eigen::AngleAxisd(motion.linear()).angle() > kElsewhereAngle;
}

/// Minimum of a function sampled at equal intervals, by a parabola through the lowest sample and its neighbors.
template <std::size_t N>
double parabola_minimum(const std::array<double, N>& at, const std::array<double, N>& values) {
  const auto best = static_cast<std::size_t>(std::min_element(values.begin(), values.end()) - values.begin());
  if (best == 0 || best + 1 == N) return at[best];
  const double before = values[best - 1], after = values[best + 1], curvature = before - 2 * values[best] + after;
  return at[best] + (curvature > 0 ? 0.5 * (before - after) / curvature : 0.0) * (at[1] - at[0]);
}

}  // namespace

Tracker::Tracker(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
                 const KeyframeDatabase& keyframes, const KeyframeStore& images)
    : device_(device),
      options_(options),
      rig_(rig),
      keyframes_(keyframes),
      images_(images),
      raycaster_(device, rectified, options.surface, options.track.levels, options.track.finest_level),
      aligner_(device, options.track, rig.sensor, is_rolling(rig)),
      reference_(device, rectified, options.track),
      gyroscope_(rig.camera_from_imu),
      inertial_(rig.camera_from_imu),
      judged_(rectified.at_level(options.track.levels - 1)),
      verdicts_(device, 4 * pixels_of(judged_)),
      moving_count_(device, 4),
      judge_(device, "moving_judge", moving_judge_comp, shader::constants_of(rig.sensor)),
      mask_(device, "moving_mask", moving_mask_comp) {}

/// Predicted pose: from the frame's given guess if recent guesses were accurate and, while not lost, more accurate than
/// the motion model; else from the motion model.
Eigen::Isometry3d Tracker::predict(const Frame& frame) const {
  const auto guessed = predict_by_guess(frame);
  const bool is_good = (state_.device.is_known() && device_drift()) ||
                       (state_.guesses >= kMinGuesses && state_.guess_error < kMaxGuessError &&
                        (state_.lost_frames > 0 || state_.guess_error <= state_.motion_error));
  return guessed && is_good ? *guessed : predict_by_motion(frame.timestamp);
}

std::optional<Eigen::Isometry3d> Tracker::predict_by_guess(const Frame& frame) const {
  if (options_.track.device_poses == DevicePoses::off || !frame.guess || !state_.last_guess) return std::nullopt;
  return state_.last.back().submap_from_camera * state_.last_guess->inverse() * *frame.guess;
}

/// Updates the running errors of both predictions with the tracked pose.
void Tracker::update_prediction_errors(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) {
  const auto error = [&](const Eigen::Isometry3d& predicted) {
    const Vector6d e = local_coordinates(predicted.inverse() * submap_from_camera);
    return e.head<3>().norm() + e.tail<3>().norm();
  };
  const auto guessed = predict_by_guess(frame);
  if (!guessed) return;
  const double share = std::max(0.05, 1.0 / (state_.guesses + 1));
  state_.guess_error += share * (error(*guessed) - state_.guess_error);
  state_.motion_error += share * (error(predict_by_motion(frame.timestamp)) - state_.motion_error);
  ++state_.guesses;
}

/// Motion model: the inertial sensor, else constant velocity of the last two fused frames, with the rotation of the
/// gyroscope if available. Without a gyroscope, a lost camera is predicted at its last pose.
Eigen::Isometry3d Tracker::predict_by_motion(double timestamp) const {
  if (const auto inertial = inertial_.predict(timestamp)) return inertial->world_from_camera;
  const Moment& last = state_.last.back();
  if (const auto rotation = gyroscope_.rotation(last.timestamp, timestamp)) {
    Eigen::Isometry3d last_from_now(*rotation);
    if (state_.last.size() == 2) {
      const Moment& before = state_.last[0];
      const Eigen::Vector3d velocity =  // in the last camera's frame
          (before.submap_from_camera.inverse() * last.submap_from_camera).translation() /
          (last.timestamp - before.timestamp);
      const double seconds = std::min(timestamp - last.timestamp, kMaxExtrapolation);
      const double velocity_factor = state_.last_is_degenerate ? kWeakVelocityFactor : 1.0;
      last_from_now.translation() =
          velocity_factor * (Eigen::Quaterniond::Identity().slerp(0.5, *rotation) * velocity * seconds);
    }
    return last.submap_from_camera * last_from_now;
  }
  if (state_.lost_frames > 0 || state_.last.size() < 2) return last.submap_from_camera;
  const double ratio = std::min((timestamp - last.timestamp) / (last.timestamp - state_.last[0].timestamp), 2.0);
  return last.submap_from_camera *
         retract(ratio * local_coordinates(state_.last[0].submap_from_camera.inverse() * last.submap_from_camera));
}

ColorMoment Tracker::moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const {
  ColorMoment moment{.stamp_delay = frame.color_delay, .clock_offset = clock_offset()};
  if (state_.last.empty() || state_.lost_frames > 0) return moment;
  const double interval = frame.timestamp - state_.last.back().timestamp;
  moment.velocity = local_coordinates(state_.last.back().submap_from_camera.inverse() * submap_from_camera) / interval;
  return moment;
}

MotionAt Tracker::motion(const Frame& frame) const {
  if (state_.last.empty() || state_.lost_frames > 0) return at_velocity(Vector6d::Zero());
  return motion(frame, predict(frame));
}

/// A rotation from the gyroscope does not depend on the predicted pose.
ShutterCorrection Tracker::shutter_correction(const Frame& frame) const {
  if (!is_rolling(rig_) || state_.last.empty() || state_.lost_frames > 0) return {};
  const double since = state_.last.back().timestamp;
  if (gyroscope_.rotation(since, frame.timestamp)) return {};
  return {.submap_from_camera = predict(frame),
          .readout = std::min(rig_.depth.readout / (frame.timestamp - since), 1.0)};
}

/// The velocity is from the poses, the rotation from the gyroscope if available.
MotionAt Tracker::motion(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const {
  if (state_.last.empty() || state_.lost_frames > 0) return at_velocity(Vector6d::Zero());
  const Moment& last = state_.last.back();
  // Mean velocity since the preceding frame. Extrapolation to the current time would amplify noise.
  const Vector6d velocity =
      local_coordinates(last.submap_from_camera.inverse() * submap_from_camera) / (frame.timestamp - last.timestamp);
  const double now = frame.timestamp;
  return [this, now, velocity](double delay) {
    const double since = std::min(now, now + delay), until = std::max(now, now + delay);
    const auto rotation = gyroscope_.rotation(since, until);
    Eigen::Isometry3d motion = retract(velocity * delay);
    if (rotation) motion.linear() = (delay > 0 ? *rotation : rotation->conjugate()).toRotationMatrix();
    return motion;
  };
}

double Tracker::clock_offset() const {
  if (state_.clock_offset_frames < kClockOffsetFrames) return 0.0;
  const auto& costs = state_.clock_offset_costs;
  const auto [min_cost, max_cost] = std::minmax_element(costs.begin(), costs.end());
  // Color that is not registered to depth has no distinct minimum.
  return *max_cost < kClockOffsetContrast * *min_cost ? 0.0 : parabola_minimum(kClockOffsets, costs);
}

FocalEvidence Tracker::focal() const {
  if (state_.focal_pairs < kFocalPairs) return {};
  const auto error = [&](double cost) { return std::sqrt(cost / state_.focal_pairs); };
  return {.scale = parabola_minimum(kFocalScales, state_.focal_costs),
          .error_given = error(state_.focal_costs[kFocalScales.size() / 2]),
          .error_best = error(*std::min_element(state_.focal_costs.begin(), state_.focal_costs.end())),
          .pairs = state_.focal_pairs};
}

std::vector<std::size_t> Tracker::candidates(const Features& seen) const {
  std::vector<std::size_t> chosen, entries;
  for (const auto& candidate : keyframes_.query_tracked(seen, kMaxSimilarKeyframes)) chosen.push_back(candidate.entry);
  for (std::size_t i = 0; i < keyframes_.size(); ++i)
    if (keyframes_[i].tracked_from_camera) entries.push_back(i);
  for (std::size_t k = 0; k < std::min(kMaxOtherKeyframes, entries.size()); ++k)
    chosen.push_back(entries[(static_cast<std::size_t>(state_.lost_frames) * kMaxOtherKeyframes + k) % entries.size()]);
  return chosen;
}

std::vector<std::size_t> Tracker::recent_keyframes() const {
  std::vector<std::size_t> recent_keyframes;
  for (std::size_t i = keyframes_.size(); i > 0 && recent_keyframes.size() < kMaxRecentKeyframes; --i)
    if (keyframes_[i - 1].tracked_from_camera) recent_keyframes.push_back(i - 1);
  return recent_keyframes;
}

/// Ignores a keyframe whose file is lost; other keyframes remain.
std::optional<PnpPose> Tracker::solve_keyframe_pnp(std::size_t keyframe, const Features& seen) const {
  try {
    return solve_pnp(*images_.features(keyframe), seen, rig_.depth);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

std::vector<Tracker::FeaturePose> Tracker::poses_by_features(const Features& seen,
                                                             const std::vector<std::size_t>& keyframes) const {
  std::vector<std::optional<PnpPose>> located(keyframes.size());
  tbb::parallel_for(std::size_t{0}, keyframes.size(),
                    [&](std::size_t k) { located[k] = solve_keyframe_pnp(keyframes[k], seen); });
  std::vector<FeaturePose> poses;
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    if (located[k])
      poses.push_back({keyframes[k], *keyframes_[keyframes[k]].tracked_from_camera * located[k]->known_from_seen,
                       located[k]->inliers});
  std::stable_sort(poses.begin(), poses.end(),
                   [](const FeaturePose& a, const FeaturePose& b) { return a.inliers > b.inliers; });
  return poses;
}

std::optional<Eigen::Isometry3d> Tracker::estimate_pose_by_features(const Features& seen,
                                                                    const std::vector<std::size_t>& keyframes) const {
  const std::vector<FeaturePose> poses = poses_by_features(seen, keyframes);
  return poses.empty() ? std::nullopt : std::optional(poses[0].tracked_from_camera);
}

bool Tracker::set_reference(std::size_t keyframe) {
  try {
    const Frame images = images_.get(keyframe);
    const FramePyramid surface = keyframe_preprocessor_->preprocess(images);
    if (surface.packed.empty()) return false;
    reference_.set(surface, *keyframes_[keyframe].tracked_from_camera, {});
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

TrackingResult Tracker::track(const Frame& frame, const FramePyramid& live, Volume& volume, StageTimes& times) {
  moving_ = {};
  if (state_.last.empty()) return start_map(frame);
  TrackingResult tracked = track_in_map(frame, live, volume, times);
  if (tracked.state == TrackingResult::State::aligned) {
    if (removes_moving_) timed(times, "track", [&] { mask_moving(live, tracked, volume); });
    return tracked;
  }
  ++state_.lost_frames;
  if (!should_start_component(frame)) return tracked;
  tracked.before_break = inertial_.predict(frame.timestamp);
  reset();
  tracked.state = TrackingResult::State::initialized;
  tracked.cause = FrameCause::new_component;
  tracked.reason = to_string(tracked.cause);
  tracked.submap_from_camera = level(frame.acceleration);
  return tracked;
}

TrackingResult Tracker::track_in_map(const Frame& frame, const FramePyramid& live, Volume& volume, StageTimes& times) {
  TrackingResult tracked =
      state_.lost_frames == 0 ? track_frame(frame, live, volume, times) : relocalize(frame, live, volume, times);
  const bool is_outside_map =
      tracked.alignment.lost == FrameCause::out_of_view ||
      (tracked.alignment.lost == FrameCause::too_few_inliers && state_.last_aligned < state_.last.back().timestamp);
  if (is_outside_map && has_enough_depth(frame) && is_device_usable(frame))
    tracked = device_prediction(frame);
  else if (is_outside_map && has_enough_depth(frame) && is_gyro_usable(frame))
    tracked = gyro_prediction(frame);
  tracked.cause = tracked.alignment.lost;
  tracked.reason = to_string(tracked.cause);
  if (!tracked.alignment.converged()) return tracked;
  tracked.state = TrackingResult::State::aligned;
  tracked.submap_from_camera = tracked.alignment.submap_from_camera;
  return tracked;
}

TrackingResult Tracker::track_only(const Frame& frame, const FramePyramid& live, Volume& volume, StageTimes& times) {
  if (state_.last.empty())
    return {.cause = FrameCause::not_relocalized, .reason = "held-out frame before the start of the map"};
  const State before = state_;
  const Raycaster::SavedState prediction = raycaster_.save(prediction_);
  TrackingResult tracked = track_in_map(frame, live, volume, times);
  state_ = before;
  prediction_ = raycaster_.restore(prediction);
  return tracked;
}

TrackingResult Tracker::start_map(const Frame& frame) const {
  if (share_between(frame.depth, options_.surface.min_depth, options_.surface.max_depth) < kMinMapDepthShare)
    return {.cause = FrameCause::too_little_depth,
            .reason = fmt::format("too little depth between {} and {} m to start the map", options_.surface.min_depth,
                                  options_.surface.max_depth)};
  return {.state = TrackingResult::State::initialized, .submap_from_camera = level(frame.acceleration)};
}

bool Tracker::has_enough_depth(const Frame& frame) {
  const auto seen = std::count_if(frame.depth.begin(), frame.depth.end(), [](float z) { return z > 0; });
  return static_cast<double>(seen) > kMinComponentDepthShare * static_cast<double>(frame.depth.size());
}

bool Tracker::should_start_component(const Frame& frame) {
  state_.lost_views += has_enough_depth(frame);
  return state_.lost_views >= options_.map.lost_frames;
}

/// Aligns the frame with the surface predicted at the guess.
TrackingResult Tracker::align(const Frame& frame, const FramePyramid& live, Volume& volume,
                              const Eigen::Isometry3d& guess, InitialGuess kind, AlignmentRange range,
                              StageTimes& times) {
  if (state_.lost_frames > 0) volume.page_in_around(guess.translation());
  prediction_ = timed(times, "raycast", [&] { return raycaster_.raycast(volume, guess); });
  state_.frames_of_prediction = 0;
  return align_with_prediction(frame, live, guess, kind, range, times);
}

/// Aligns the frame with the last predicted surface.
TrackingResult Tracker::align_with_prediction(const Frame& frame, const FramePyramid& live,
                                              const Eigen::Isometry3d& guess, InitialGuess kind, AlignmentRange range,
                                              StageTimes& times) {
  ++state_.frames_of_prediction;
  return timed(times, "track", [&] {
    return TrackingResult{.alignment = aligner_.align(live, prediction_, guess, &reference_, moment_of(frame, guess),
                                                      range, shutter_correction(frame)),
                          .guess = kind,
                          .predicted_from = prediction_.submap_from_camera};
  });
}

bool Tracker::is_prediction_reusable(const Eigen::Isometry3d& guess) const {
  return !prediction_.levels.empty() &&
         cairn::is_prediction_reusable(rig_.depth, prediction_.submap_from_camera.inverse() * guess,
                                       state_.frames_of_prediction);
}

bool Tracker::is_view_wide(const Eigen::Isometry3d& predicted) const {
  const Moment& last = state_.last.back();
  const auto is_wide = [&](const Eigen::Isometry3d& motion) {
    return view_change(rig_.depth, motion) > kWideViewChange;
  };
  return is_wide(last.submap_from_camera.inverse() * predicted) ||
         is_wide(state_.last.front().submap_from_camera.inverse() * last.submap_from_camera);
}

/// Tracks a frame that follows a fused one. Guesses are the prediction, the last pose, and the pose from features,
/// which comes first for wide steps.
TrackingResult Tracker::track_frame(const Frame& frame, const FramePyramid& live, Volume& volume, StageTimes& times) {
  const Moment& last = state_.last.back();
  const auto try_from = [&](const Eigen::Isometry3d& guess, InitialGuess kind,
                            AlignmentRange range = AlignmentRange::coarse_to_fine) {
    return align(frame, live, volume, guess, kind, range, times);
  };
  std::optional<std::optional<Eigen::Isometry3d>> pose_by_features;  // once searched
  const auto by_features = [&] {
    if (!pose_by_features)
      pose_by_features = timed(times, "recognize", [&] {
        return estimate_pose_by_features(features_of(live, rig_, device_), recent_keyframes());
      });
    return *pose_by_features;
  };
  const Eigen::Isometry3d predicted = predict(frame);
  const bool is_wide = is_view_wide(predicted);
  TrackingResult best;
  best.alignment.lost = FrameCause::not_relocalized;
  if (is_wide)
    if (const auto guess = by_features()) best = try_from(*guess, InitialGuess::features);
  if (is_doubtful(best.alignment, state_.typical)) {
    const bool reuses_prediction = is_prediction_reusable(predicted);
    TrackingResult moved = reuses_prediction ? align_with_prediction(frame, live, predicted, InitialGuess::motion,
                                                                     AlignmentRange::coarse_to_fine, times)
                                             : try_from(predicted, InitialGuess::motion);
    if (reuses_prediction && is_doubtful(moved.alignment, state_.typical))
      moved = try_from(predicted, InitialGuess::motion);
    if (!best.alignment.converged() || is_better(moved.alignment, best.alignment)) best = std::move(moved);
  }
  if (!best.alignment.converged())
    best = try_from(last.submap_from_camera, InitialGuess::still);  // the camera may have stopped
  if (is_doubtful(best.alignment, state_.typical)) {
    if (const auto guess = by_features()) {
      if (TrackingResult other = try_from(*guess, InitialGuess::features); is_better(other.alignment, best.alignment))
        best = std::move(other);
      // With moving objects in view, brightness separates the static scene's pose from the moving object's.
      if (TrackingResult other = try_from(*guess, InitialGuess::features, AlignmentRange::finest_only);
          is_static_pose(other.alignment, best.alignment))
        best = std::move(other);
    }
  }
  const Vector6d motion = local_coordinates(last.submap_from_camera.inverse() * predicted);
  for (const double factor : kMotionFactors)
    if (is_wide && is_doubtful(best.alignment, state_.typical)) {
      TrackingResult other = try_from(last.submap_from_camera * retract(factor * motion), InitialGuess::motion);
      if (is_better(other.alignment, best.alignment)) best = std::move(other);
    }
  Alignment& a = best.alignment;
  if (!a.converged()) return best;
  fuse_device_motion(frame, best);
  if (inertial_.has_samples()) best.measured = measurement_of(frame, best);
  fuse_inertial_prediction(frame, best);
  if (!is_possible(last.submap_from_camera.inverse() * a.submap_from_camera, frame.timestamp - last.timestamp,
                   options_.motion))
    a.lost = FrameCause::too_fast;
  else if (is_poor(a, state_.typical))
    a.lost = FrameCause::poor_fit;
  return best;
}

/// Relocalizes a lost camera: at its last pose, or by features if the alignment is reliable.
TrackingResult Tracker::relocalize(const Frame& frame, const FramePyramid& live, Volume& volume, StageTimes& times) {
  TrackingResult tracked =
      align(frame, live, volume, predict(frame), InitialGuess::motion, AlignmentRange::coarse_to_fine, times);
  if (is_certain_in_place(tracked.alignment, state_.lost_frames, state_.typical)) return tracked;
  if (is_gyro_usable(frame) && tracked.alignment.converged() && is_near(tracked.alignment, tracked.predicted_from))
    return tracked;
  if (confirms_inertial(frame, tracked)) return tracked;
  const std::vector<FeaturePose> guesses = timed(times, "recognize", [&] {
    const Features seen = features_of(live, rig_, device_);
    return poses_by_features(seen, candidates(seen));
  });
  const auto certain_at = [&](const FeaturePose& guess) -> std::optional<TrackingResult> {
    const bool has_reference = keyframe_preprocessor_ != nullptr && set_reference(guess.keyframe);
    TrackingResult other = align(frame, live, volume, guess.tracked_from_camera, InitialGuess::relocalized,
                                 AlignmentRange::coarse_to_fine, times);
    if (has_reference) {
      const bool is_found = is_certain(other.alignment, state_.typical);
      reference_.clear();  // the next frames use this frame: things may have moved since the keyframe
      if (!is_found)       // another light
        other = align_with_prediction(frame, live, guess.tracked_from_camera, InitialGuess::relocalized,
                                      AlignmentRange::coarse_to_fine, times);
    }
    return is_certain(other.alignment, state_.typical) ? std::optional(std::move(other)) : std::nullopt;
  };
  const bool is_localizing = !removes_moving_;
  for (std::size_t i = 0; i < std::min(guesses.size(), is_localizing ? kMaxGuesses : 1); ++i) {
    const auto found = certain_at(guesses[i]);
    if (!found) continue;
    const auto is_rival = [&](const FeaturePose& other) {
      return other.inliers >= kMinRivalShare * guesses[i].inliers &&
             is_elsewhere(found->alignment.submap_from_camera, other.tracked_from_camera) && certain_at(other);
    };
    if (!is_localizing || std::none_of(guesses.begin(), guesses.end(), is_rival)) return *found;
    break;  // at two places that look alike
  }
  if (tracked.alignment.converged()) tracked.alignment.lost = FrameCause::not_relocalized;
  return tracked;
}

/// True if the gyroscope can replace an alignment.
bool Tracker::is_gyro_usable(const Frame& frame) const {
  return gyroscope_.rotation(state_.last.back().timestamp, frame.timestamp) &&
         frame.timestamp - state_.last_aligned <= kMaxGyroSeconds;
}

/// Pose from the inertial sensor, for a camera that sees no map or only surface that is just being added to the map.
TrackingResult Tracker::gyro_prediction(const Frame& frame) const {
  TrackingResult gyro_prediction{.alignment = {.submap_from_camera = predict(frame)}, .guess = InitialGuess::gyroscope};
  gyro_prediction.predicted_from = gyro_prediction.alignment.submap_from_camera;
  gyro_prediction.alignment.fit.unobserved = kAllUnobserved;
  if (const auto inertial = inertial_prediction(frame.timestamp)) {
    gyro_prediction.alignment.information = kCorrelatedPoints * inertial->covariance.inverse();
    return gyro_prediction;
  }
  gyro_prediction.alignment.information.diagonal()
      << Eigen::Vector3d::Constant(1 / (kGyroRotationSigma * kGyroRotationSigma)),
      Eigen::Vector3d::Constant(1 / (kGyroTranslationSigma * kGyroTranslationSigma));
  return gyro_prediction;
}

void Tracker::add_inertial(const Frame& frame) {
  inertial_.add(frame.gyro, frame.accelerations);
  if (!inertial_.is_gyro_contradicted()) gyroscope_.add(frame.gyro);
}

std::string Tracker::inertial_contradiction() const {
  if (inertial_.is_gyro_contradicted())
    return "the gyroscope and the accelerometer contradict the tracked motion (axes, sign, unit or clock): "
           "they are not used";
  if (inertial_.is_contradicted())
    return "the accelerometer contradicts the tracked motion (axes, sign, unit or clock): only the gyroscope is used";
  return {};
}

InertialKeyframe Tracker::take_inertial_keyframe() {
  return inertial_.take_keyframe(state_.last.back().timestamp, state_.last.back().submap_from_camera);
}

std::optional<InertialOdometry::Prediction> Tracker::inertial_prediction(double timestamp) const {
  auto predicted = inertial_.predict(timestamp);
  if (predicted && predicted->position_sigma() > kMaxInertialSigma) predicted.reset();
  return predicted;
}

bool Tracker::confirms_inertial(const Frame& frame, const TrackingResult& tracked) const {
  if (!tracked.alignment.converged()) return false;
  const auto predicted = inertial_prediction(frame.timestamp);
  return predicted && is_near(tracked.alignment, predicted->world_from_camera,
                              kInertialSigmas * std::sqrt(predicted->covariance.topLeftCorner<3, 3>().trace()),
                              kInertialSigmas * predicted->position_sigma());
}

InertialOdometry::TrackedPose Tracker::measurement_of(const Frame& frame, const TrackingResult& tracked) const {
  const Alignment& a = tracked.alignment;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(a.information);
  Vector6d values = solver.eigenvalues().cwiseMax(0.0);
  values.head(std::clamp(a.fit.unobserved, 0, 6)).setZero();  // the guess, instead of a measurement
  const Vector6d variances = (kCorrelatedPoints * (values.array() + 1).inverse()).matrix();
  const Matrix6d in_view = solver.eigenvectors() * variances.asDiagonal() * solver.eigenvectors().transpose();
  const Matrix6d camera_from_view = adjoint(a.submap_from_camera.inverse() * tracked.predicted_from);
  Matrix6d covariance = camera_from_view * in_view * camera_from_view.transpose();
  covariance += covariance_of({.rotation = kMinRotationSigma, .translation = kMinTranslationSigma});
  if (rig_.sensor.common_error >= kUncertainSensor) covariance += covariance_of(common_error(rig_.sensor, frame.depth));
  return {frame.timestamp, a.submap_from_camera, covariance};
}

/// The directions stay unobserved in the report: neither the gyroscope's bias nor the map's criteria use them.
void Tracker::fuse_inertial_prediction(const Frame& frame, TrackingResult& tracked) const {
  Alignment& a = tracked.alignment;
  if (a.fit.unobserved == 0 && is_confirmed_by_brightness(a, state_.typical)) return;
  const auto predicted = inertial_.predict(frame.timestamp);
  if (!predicted) return;
  const int unobserved = a.fit.unobserved;
  const PoseSigma error = common_error(rig_.sensor, frame.depth);
  if (!fuse_device_pose(predicted->world_from_camera, predicted->covariance, error, a) &&
      predicted->position_sigma() <= kMaxInertialSigma) {  // the alignment has jumped
    a.submap_from_camera = predicted->world_from_camera;
    a.information = kCorrelatedPoints * predicted->covariance.inverse();
  }
  a.fit.unobserved = unobserved;
}

std::optional<DeviceDrift> Tracker::device_drift() const {
  if (options_.track.device_poses != DevicePoses::prior) return std::nullopt;
  if (!state_.device.is_known() && rig_.sensor.common_error < kUncertainSensor) return std::nullopt;
  return state_.device.drift();
}

/// True if the device can replace an alignment.
bool Tracker::is_device_usable(const Frame& frame) const {
  return frame.guess && state_.last_guess && device_drift() &&
         frame.timestamp - state_.last_aligned <= kMaxDeviceSeconds;
}

/// Covariance of the motion from the last fused frame to a pose predicted by the device.
Matrix6d Tracker::device_motion_covariance(const Eigen::Isometry3d& predicted) const {
  return device_covariance(*device_drift(), state_.last.back().submap_from_camera.inverse() * predicted);
}

/// Pose from the device, for a camera that sees no map or only surface that is just being added to the map.
TrackingResult Tracker::device_prediction(const Frame& frame) const {
  TrackingResult predicted{.alignment = {.submap_from_camera = *predict_by_guess(frame)},
                           .guess = InitialGuess::device};
  predicted.predicted_from = predicted.alignment.submap_from_camera;
  predicted.alignment.fit.unobserved = kAllUnobserved;
  predicted.alignment.information = device_motion_covariance(predicted.predicted_from).inverse();
  return predicted;
}

/// If alignment and device contradict each other, one of them has jumped; the pose that continues the motion is kept.
void Tracker::fuse_device_motion(const Frame& frame, TrackingResult& tracked) const {
  Alignment& a = tracked.alignment;
  const auto predicted = predict_by_guess(frame);
  if (!predicted || !device_drift()) return;
  tracked.aligned = {a.submap_from_camera, common_error(rig_.sensor, frame.depth)};
  const Matrix6d covariance = device_motion_covariance(*predicted);
  if (fuse_device_pose(*predicted, covariance, tracked.aligned->common_error, a)) return;
  tracked.aligned->contradicts_device = true;
  const Eigen::Isometry3d continued = predict_by_motion(frame.timestamp);
  const auto jump = [&](const Eigen::Isometry3d& pose) { return view_change(rig_.depth, continued.inverse() * pose); };
  if (jump(*predicted) >= jump(a.submap_from_camera)) return;
  a.submap_from_camera = *predicted;
  a.information = covariance.inverse();
}

void Tracker::mask_moving(const FramePyramid& live, const TrackingResult& tracked, const Volume& volume) {
  if (!reference_.is_set() || live.packed.empty()) return;
  const Eigen::Isometry3d& submap_from_camera = tracked.submap_from_camera;
  // A later, rejected guess may have changed the predicted surface.
  if (prediction_.submap_from_camera.matrix() != tracked.predicted_from.matrix())
    prediction_ = raycaster_.raycast(volume, tracked.predicted_from);
  const auto level = static_cast<std::size_t>(options_.track.levels - 1);
  const Camera& camera = live.levels[level]->camera;
  const auto width = static_cast<std::uint32_t>(camera.width), height = static_cast<std::uint32_t>(camera.height);
  gpu::Batch batch(device_);
  batch.fill(moving_count_, 0);
  judge_(batch, {width, height, 1},
         {.camera = shader::pinhole(camera),
          .model_from_live = shader::rigid(prediction_.submap_from_camera.inverse() * submap_from_camera),
          .keyframe_from_live = shader::rigid(reference_.submap_from_camera().inverse() * submap_from_camera)},
         {&live.levels[level]->points, &prediction_.levels[level]->points, &reference_.level(options_.track.levels - 1),
          &verdicts_});
  shader::MovingMaskPush push{.width = width,
                              .height = height,
                              .factor = 1u << level,
                              .full_width = static_cast<std::uint32_t>(live.levels[0]->camera.width),
                              .max_count = max_moving_pixels(camera),
                              .only_count = 0};
  for (const std::uint32_t only_count : {1u, 0u}) {
    push.only_count = only_count;
    mask_(batch, {width, height, 1}, push, {&verdicts_, live.packed[level], live.fusion, &moving_count_});
  }
  batch.download(moving_count_, std::span<std::uint32_t>(moving_));
  batch.submit();
}

double Tracker::moving() const {
  device_.wait();
  const Camera& camera = judged_;
  return moving_[0] > max_moving_pixels(camera)
             ? 0.0
             : static_cast<double>(moving_[0]) / static_cast<double>(pixels_of(camera));
}

void Tracker::reset() {
  state_.last.clear();
  state_.lost_frames = state_.lost_views = 0;
  reference_.clear();
  prediction_ = {};
  inertial_.reset_world();
}

void Tracker::start_lost() {
  reset();
  const auto newest = recent_keyframes();
  state_.last = {{0, newest.empty() ? Eigen::Isometry3d::Identity() : *keyframes_[newest[0]].tracked_from_camera}};
  state_.lost_frames = kMaxLostFramesInPlace + 1;
}

Tracker::SavedState Tracker::save() const {
  return {.state = state_,
          .reference = reference_.save(),
          .prediction = raycaster_.save(prediction_),
          .gyroscope = gyroscope_.save(),
          .inertial = inertial_.save()};
}

void Tracker::restore(const SavedState& saved) {
  state_ = saved.state;
  reference_.restore(saved.reference);
  prediction_ = raycaster_.restore(saved.prediction);
  gyroscope_.restore(saved.gyroscope);
  inertial_.restore(saved.inertial);
}

void Tracker::add_focal_evidence() {
  if (keyframes_.size() < 2 || !keyframes_[keyframes_.size() - 2].tracked_from_camera) return;
  const std::size_t seen = keyframes_.size() - 1, known = seen - 1;
  const Eigen::Isometry3d motion =
      keyframes_[known].tracked_from_camera->inverse() * *keyframes_[seen].tracked_from_camera;
  if (Eigen::AngleAxisd(motion.linear()).angle() < kFocalTurn) return;
  const auto costs = focal_costs(*images_.features(known), *images_.features(seen), rig_.depth);
  for (std::size_t i = 0; i < costs.size(); ++i) state_.focal_costs[i] += costs[i];
  state_.focal_pairs += !costs.empty();
}

bool Tracker::is_reference_due(const FramePyramid& live, const TrackingResult& tracked) const {
  const Alignment* a = tracked.state == TrackingResult::State::aligned ? &tracked.alignment : nullptr;
  return !live.packed.empty() &&
         (!reference_.is_set() || is_new_reference(reference_.submap_from_camera(), tracked.submap_from_camera, a));
}

void Tracker::commit(const Frame& frame, const FramePyramid& live, const TrackingResult& tracked) {
  const Eigen::Isometry3d& pose = tracked.submap_from_camera;
  const Alignment* a = tracked.state == TrackingResult::State::aligned ? &tracked.alignment : nullptr;
  const ColorMoment moment = moment_of(frame, pose);
  if (a != nullptr && !a->clock_offset_costs.empty()) {
    for (std::size_t k = 0; k < kClockOffsets.size(); ++k) state_.clock_offset_costs[k] += a->clock_offset_costs[k];
    ++state_.clock_offset_frames;
  }
  if (is_reference_due(live, tracked)) reference_.set(live, pose, moment);
  if (a != nullptr && a->fit.iterations > 0) state_.typical.add(*a);
  if (a != nullptr && a->fit.unobserved == 0 && state_.lost_frames == 0)
    gyroscope_.learn(state_.last.back().timestamp, frame.timestamp,
                     Eigen::Quaterniond((state_.last.back().submap_from_camera.inverse() * pose).linear()));
  gyroscope_.forget_before(frame.timestamp);
  if (a != nullptr && a->fit.unobserved < kAllUnobserved && inertial_.has_samples()) {
    const auto measured = tracked.measured ? *tracked.measured : measurement_of(frame, tracked);
    inertial_.update(measured.timestamp, measured.world_from_camera, measured.covariance);
    if (inertial_.is_gyro_contradicted()) gyroscope_.restore({});
  }
  if (a != nullptr && a->fit.unobserved == 0 && state_.lost_frames == 0) update_prediction_errors(frame, pose);
  if (a == nullptr || state_.lost_frames > 0) state_.device.window.reset();
  if (frame.guess)
    state_.device.add(frame.timestamp, frame.guess,
                      tracked.aligned ? *tracked.aligned : AlignedPose{pose, common_error(rig_.sensor, frame.depth)});
  else
    state_.device.add(frame.timestamp, std::nullopt, {});
  state_.last_guess = frame.guess;
  state_.last_is_degenerate = a != nullptr && a->fit.unobserved > 0;
  if (a == nullptr || a->fit.unobserved < kAllUnobserved) state_.last_aligned = frame.timestamp;
  if (state_.lost_frames > 0) state_.last.clear();  // no velocity across a gap
  state_.lost_frames = state_.lost_views = 0;
  if (state_.last.size() == 2) state_.last.erase(state_.last.begin());
  state_.last.push_back({frame.timestamp, pose});
}

}  // namespace cairn
