// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/tracker.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "map/frame_features.hpp"
#include "map/tracking_criteria.hpp"
#include "shaders/noise.h"
#include "spirv/moving_judge.comp.h"
#include "spirv/moving_mask.comp.h"

namespace cairn {
namespace {

constexpr int kClockOffsetFrames = 10;        // min. frames for a clock offset estimate
constexpr int kFocalPairs = 4;                // min. pairs of views for a focal length estimate
constexpr double kFocalTurn = 0.1;            // min. rotation in rad between the two views of a pair
constexpr double kClockOffsetContrast = 1.5;  // min. ratio of the worst to the best cost
constexpr std::size_t kRecentPlaces = 4, kMostSimilar = 6, kOtherPlaces = 4;  // keyframes to compare a frame with
constexpr double kMaxMoving = 0.3;                                            // share of the image
constexpr int kNothingObserved = 6;                           // unobserved directions of a pose without alignment
constexpr double kCarried = 0.3;                              // max. seconds of tracking by gyroscope alone
constexpr double kCarriedTurn = 0.005, kCarriedShift = 0.02;  // rad, m: sigma of a pose by gyroscope alone
constexpr double kSameView = 0.03;    // share of the image's width: max. view change to reuse a predicted surface
constexpr int kFramesOfView = 5;      // max. frames per predicted surface, since the map grows
constexpr double kBelieved = 0.8;     // factor on a velocity that was itself weakly observed: hand motion reverses
constexpr int kEnoughGuesses = 5;     // min. number to trust given guesses
constexpr double kGoodGuess = 0.03;   // rad and m summed: max. error of a good guess from frame to frame
constexpr double kCoasting = 0.5;     // max. seconds to extrapolate a velocity
constexpr double kEnoughDepth = 0.2;  // share of the image with depth, to start a component
constexpr double kLeastDepth = 0.02;  // share of the image with depth, to start the map; the alignment's minimum

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
std::uint32_t most_moving(const Camera& camera) {
  return static_cast<std::uint32_t>(kMaxMoving * static_cast<double>(pixels_of(camera)));
}

/// Share of the depth image between two depths.
double share_between(const std::vector<float>& depth, float least, float most) {
  const auto seen = std::count_if(depth.begin(), depth.end(), [&](float z) { return z >= least && z <= most; });
  return static_cast<double>(seen) / static_cast<double>(depth.size());
}

/// Minimum of a function sampled at equal intervals, by a parabola through the lowest sample and its neighbors.
template <std::size_t N>
double lowest(const std::array<double, N>& at, const std::array<double, N>& values) {
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
      judged_(rectified.at_level(options.track.levels - 1)),
      verdicts_(device, 4 * pixels_of(judged_)),
      moving_count_(device, 4),
      judge_(device, "moving_judge", moving_judge_comp, shader::constants_of(rig.sensor)),
      mask_(device, "moving_mask", moving_mask_comp) {}

/// Predicted pose: from the frame's given guess if recent guesses were accurate and, while not lost, more accurate than
/// the motion model; else from the motion model.
Eigen::Isometry3d Tracker::predict(const Frame& frame) const {
  const auto guessed = predict_by_guess(frame);
  const bool is_good = memory_.guesses >= kEnoughGuesses && memory_.guess_error < kGoodGuess &&
                       (memory_.lost_frames > 0 || memory_.guess_error <= memory_.motion_error);
  return guessed && is_good ? *guessed : predict_by_motion(frame.timestamp);
}

std::optional<Eigen::Isometry3d> Tracker::predict_by_guess(const Frame& frame) const {
  if (!frame.guess || !memory_.last_guess) return std::nullopt;
  return memory_.last.back().submap_from_camera * memory_.last_guess->inverse() * *frame.guess;
}

/// Updates the running errors of both predictions with the tracked pose.
void Tracker::judge_guess(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) {
  const auto error = [&](const Eigen::Isometry3d& predicted) {
    const Vector6d e = local_coordinates(predicted.inverse() * submap_from_camera);
    return e.head<3>().norm() + e.tail<3>().norm();
  };
  const auto guessed = predict_by_guess(frame);
  if (!guessed) return;
  const double share = std::max(0.05, 1.0 / (memory_.guesses + 1));
  memory_.guess_error += share * (error(*guessed) - memory_.guess_error);
  memory_.motion_error += share * (error(predict_by_motion(frame.timestamp)) - memory_.motion_error);
  ++memory_.guesses;
}

/// Motion model: constant velocity of the last two fused frames, with the rotation of the gyroscope if available.
/// Without a gyroscope, a lost camera is predicted at its last pose.
Eigen::Isometry3d Tracker::predict_by_motion(double timestamp) const {
  const Moment& last = memory_.last.back();
  if (const auto turn = gyroscope_.turn(last.timestamp, timestamp)) {
    Eigen::Isometry3d last_from_now(*turn);
    if (memory_.last.size() == 2) {
      const Moment& before = memory_.last[0];
      const Eigen::Vector3d velocity =  // in the last camera's frame
          (before.submap_from_camera.inverse() * last.submap_from_camera).translation() /
          (last.timestamp - before.timestamp);
      const double seconds = std::min(timestamp - last.timestamp, kCoasting);
      const double believed = memory_.last_is_weak ? kBelieved : 1.0;
      last_from_now.translation() = believed * (Eigen::Quaterniond::Identity().slerp(0.5, *turn) * velocity * seconds);
    }
    return last.submap_from_camera * last_from_now;
  }
  if (memory_.lost_frames > 0 || memory_.last.size() < 2) return last.submap_from_camera;
  const double ratio = std::min((timestamp - last.timestamp) / (last.timestamp - memory_.last[0].timestamp), 2.0);
  return last.submap_from_camera *
         retract(ratio * local_coordinates(memory_.last[0].submap_from_camera.inverse() * last.submap_from_camera));
}

ColourMoment Tracker::moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const {
  ColourMoment moment{.stamp_delay = frame.colour_delay, .clock_offset = clock_offset()};
  if (memory_.last.empty() || memory_.lost_frames > 0) return moment;
  const double interval = frame.timestamp - memory_.last.back().timestamp;
  moment.velocity = local_coordinates(memory_.last.back().submap_from_camera.inverse() * submap_from_camera) / interval;
  return moment;
}

MotionAt Tracker::motion(const Frame& frame) const {
  if (memory_.last.empty() || memory_.lost_frames > 0) return at_velocity(Vector6d::Zero());
  return motion(frame, predict(frame));
}

/// A rotation from the gyroscope does not depend on the predicted pose.
UndoneShutter Tracker::undone(const Frame& frame) const {
  if (!is_rolling(rig_) || memory_.last.empty() || memory_.lost_frames > 0) return {};
  const double since = memory_.last.back().timestamp;
  if (gyroscope_.turn(since, frame.timestamp)) return {};
  return {.submap_from_camera = predict(frame),
          .readout = std::min(rig_.depth.readout / (frame.timestamp - since), 1.0)};
}

/// The velocity is from the poses, the rotation from the gyroscope if available.
MotionAt Tracker::motion(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const {
  if (memory_.last.empty() || memory_.lost_frames > 0) return at_velocity(Vector6d::Zero());
  const Moment& last = memory_.last.back();
  // Mean velocity since the preceding frame. Extrapolation to the current time would amplify noise.
  const Vector6d velocity =
      local_coordinates(last.submap_from_camera.inverse() * submap_from_camera) / (frame.timestamp - last.timestamp);
  const double now = frame.timestamp;
  return [this, now, velocity](double delay) {
    const double since = std::min(now, now + delay), until = std::max(now, now + delay);
    const auto turn = gyroscope_.turn(since, until);
    Eigen::Isometry3d motion = retract(velocity * delay);
    if (turn) motion.linear() = (delay > 0 ? *turn : turn->conjugate()).toRotationMatrix();
    return motion;
  };
}

double Tracker::clock_offset() const {
  if (memory_.clock_offset_frames < kClockOffsetFrames) return 0.0;
  const auto& costs = memory_.clock_offset_costs;
  const auto [least, most] = std::minmax_element(costs.begin(), costs.end());
  // Color that is not registered to depth has no distinct minimum.
  return *most < kClockOffsetContrast * *least ? 0.0 : lowest(kClockOffsets, costs);
}

FocalEvidence Tracker::focal() const {
  if (memory_.focal_pairs < kFocalPairs) return {};
  const auto error = [&](double cost) { return std::sqrt(cost / memory_.focal_pairs); };
  return {.scale = lowest(kFocalScales, memory_.focal_costs),
          .error_given = error(memory_.focal_costs[kFocalScales.size() / 2]),
          .error_best = error(*std::min_element(memory_.focal_costs.begin(), memory_.focal_costs.end())),
          .pairs = memory_.focal_pairs};
}

std::vector<std::size_t> Tracker::candidates(const Features& seen) const {
  std::vector<std::size_t> chosen, here;
  for (const auto& candidate : keyframes_.query_tracked(seen, kMostSimilar)) chosen.push_back(candidate.entry);
  for (std::size_t i = 0; i < keyframes_.size(); ++i)
    if (keyframes_[i].tracked_from_camera) here.push_back(i);
  for (std::size_t k = 0; k < std::min(kOtherPlaces, here.size()); ++k)
    chosen.push_back(here[(static_cast<std::size_t>(memory_.lost_frames) * kOtherPlaces + k) % here.size()]);
  return chosen;
}

std::vector<std::size_t> Tracker::recent() const {
  std::vector<std::size_t> recent;
  for (std::size_t i = keyframes_.size(); i > 0 && recent.size() < kRecentPlaces; --i)
    if (keyframes_[i - 1].tracked_from_camera) recent.push_back(i - 1);
  return recent;
}

/// Ignores a keyframe whose file is lost; other keyframes remain.
std::optional<PnpPose> Tracker::locate(std::size_t keyframe, const Features& seen) const {
  try {
    return solve_pnp(*images_.features(keyframe), seen, rig_.depth);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
}

std::optional<Eigen::Isometry3d> Tracker::recognise(const Features& seen,
                                                    const std::vector<std::size_t>& keyframes) const {
  std::vector<std::optional<PnpPose>> located(keyframes.size());
  tbb::parallel_for(std::size_t{0}, keyframes.size(), [&](std::size_t k) { located[k] = locate(keyframes[k], seen); });
  std::optional<Eigen::Isometry3d> guess;
  int most = 0;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    if (!located[k] || located[k]->inliers <= most) continue;
    most = located[k]->inliers;
    guess = *keyframes_[keyframes[k]].tracked_from_camera * located[k]->known_from_seen;
  }
  return guess;
}

Tracked Tracker::track(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  moving_ = {};
  if (memory_.last.empty()) return begin_map(frame);
  Tracked tracked = find(frame, live, volume, times);
  if (tracked.state == Tracked::State::aligned) {
    timed(times, "track", [&] { leave_out_moving(live, tracked, volume); });
    return tracked;
  }
  ++memory_.lost_frames;
  if (!gives_up(frame)) return tracked;
  restart();
  tracked.state = Tracked::State::begins;
  tracked.cause = FrameCause::new_component;
  tracked.reason = text_of(tracked.cause);
  tracked.submap_from_camera = level(frame.acceleration);
  return tracked;
}

Tracked Tracker::find(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  Tracked tracked =
      memory_.lost_frames == 0 ? follow(frame, live, volume, times) : relocalise(frame, live, volume, times);
  const bool sees_no_map =
      tracked.alignment.lost == FrameCause::out_of_view ||
      (tracked.alignment.lost == FrameCause::too_few_inliers && memory_.last_aligned < memory_.last.back().timestamp);
  if (sees_no_map && sees_enough(frame) && carries(frame)) tracked = carried(frame);
  tracked.cause = tracked.alignment.lost;
  tracked.reason = text_of(tracked.cause);
  if (!tracked.alignment.converged()) return tracked;
  tracked.state = Tracked::State::aligned;
  tracked.submap_from_camera = tracked.alignment.submap_from_camera;
  return tracked;
}

Tracked Tracker::look(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  if (memory_.last.empty())
    return {.cause = FrameCause::not_relocalised, .reason = "held out, and there is no map yet to find it in"};
  const Memory before = memory_;
  const Raycaster::Saved prediction = raycaster_.save(prediction_);
  Tracked tracked = find(frame, live, volume, times);
  memory_ = before;
  prediction_ = raycaster_.restore(prediction);
  return tracked;
}

Tracked Tracker::begin_map(const Frame& frame) const {
  if (share_between(frame.depth, options_.surface.min_depth, options_.surface.max_depth) < kLeastDepth)
    return {.cause = FrameCause::too_little_depth,
            .reason = fmt::format("too little depth between {} and {} m to begin the map with",
                                  options_.surface.min_depth, options_.surface.max_depth)};
  return {.state = Tracked::State::begins, .submap_from_camera = level(frame.acceleration)};
}

bool Tracker::sees_enough(const Frame& frame) {
  const auto seen = std::count_if(frame.depth.begin(), frame.depth.end(), [](float z) { return z > 0; });
  return static_cast<double>(seen) > kEnoughDepth * static_cast<double>(frame.depth.size());
}

bool Tracker::gives_up(const Frame& frame) {
  memory_.lost_views += sees_enough(frame);
  return memory_.lost_views >= options_.map.lost_frames;
}

/// Aligns the frame with the surface predicted at the guess.
Tracked Tracker::align(const Frame& frame, const Surface& live, Volume& volume, const Eigen::Isometry3d& guess,
                       const char* name, Reach reach, StageTimes& times) {
  if (memory_.lost_frames > 0) volume.bring(guess.translation());
  prediction_ = timed(times, "raycast", [&] { return raycaster_.raycast(volume, guess); });
  memory_.frames_of_view = 0;
  return align_with_view(frame, live, guess, name, reach, times);
}

/// Aligns the frame with the last predicted surface.
Tracked Tracker::align_with_view(const Frame& frame, const Surface& live, const Eigen::Isometry3d& guess,
                                 const char* name, Reach reach, StageTimes& times) {
  ++memory_.frames_of_view;
  return timed(times, "track", [&] {
    return Tracked{.alignment = aligner_.align(live, prediction_, guess, &reference_, moment_of(frame, guess), reach,
                                               undone(frame)),
                   .guess = name,
                   .predicted_from = prediction_.submap_from_camera};
  });
}

bool Tracker::still_sees(const Eigen::Isometry3d& guess) const {
  if (prediction_.levels.empty() || memory_.frames_of_view >= kFramesOfView) return false;
  return view_change(rig_.depth, prediction_.submap_from_camera.inverse() * guess) < kSameView;
}

/// Tracks a frame that follows a fused one. Guesses are the prediction, the last pose, and the pose from features.
Tracked Tracker::follow(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  const Moment& last = memory_.last.back();
  const auto try_from = [&](const Eigen::Isometry3d& guess, const char* name, Reach reach = Reach::wide) {
    return align(frame, live, volume, guess, name, reach, times);
  };
  const Eigen::Isometry3d predicted = predict(frame);
  const bool kept = still_sees(predicted);
  Tracked best =
      kept ? align_with_view(frame, live, predicted, "motion", Reach::wide, times) : try_from(predicted, "motion");
  if (kept && (!best.alignment.converged() || is_doubtful(best.alignment, memory_.usual_brightness)))
    best = try_from(predicted, "motion");
  if (!best.alignment.converged()) best = try_from(last.submap_from_camera, "still");  // the camera may have stopped
  if (is_doubtful(best.alignment, memory_.usual_brightness)) {
    if (const auto guess =
            timed(times, "recognise", [&] { return recognise(features_of(live, rig_, device_), recent()); })) {
      if (Tracked other = try_from(*guess, "features"); is_better(other.alignment, best.alignment))
        best = std::move(other);
      // With moving objects in view, brightness separates the static scene's pose from the moving object's.
      if (Tracked other = try_from(*guess, "features", Reach::close); tells_apart(other.alignment, best.alignment))
        best = std::move(other);
    }
  }
  Alignment& a = best.alignment;
  if (!a.converged()) return best;
  if (!is_possible(last.submap_from_camera.inverse() * a.submap_from_camera, frame.timestamp - last.timestamp,
                   options_.motion))
    a.lost = FrameCause::too_fast;
  else if (misfit(a) > kMisfit)
    a.lost = FrameCause::poor_fit;
  return best;
}

/// Relocalizes a lost camera: at its last pose, or by features if the alignment is reliable.
Tracked Tracker::relocalise(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  Tracked tracked = align(frame, live, volume, predict(frame), "motion", Reach::wide, times);
  if (is_certain_in_place(tracked.alignment, memory_.lost_frames)) return tracked;
  if (carries(frame) && tracked.alignment.converged() && is_near(tracked.alignment, tracked.predicted_from))
    return tracked;
  const auto guess = timed(times, "recognise", [&] {
    const Features seen = features_of(live, rig_, device_);
    return recognise(seen, candidates(seen));
  });
  if (guess)
    if (Tracked other = align(frame, live, volume, *guess, "relocalised", Reach::wide, times);
        is_certain(other.alignment))
      return other;
  if (tracked.alignment.converged()) tracked.alignment.lost = FrameCause::not_relocalised;
  return tracked;
}

/// True if the gyroscope can replace an alignment.
bool Tracker::carries(const Frame& frame) const {
  return gyroscope_.turn(memory_.last.back().timestamp, frame.timestamp) &&
         frame.timestamp - memory_.last_aligned <= kCarried;
}

/// Pose from the gyroscope, for a camera that sees no map or only surface that is just being added to the map.
Tracked Tracker::carried(const Frame& frame) const {
  Tracked carried{.alignment = {.submap_from_camera = predict(frame)}, .guess = "gyroscope"};
  carried.predicted_from = carried.alignment.submap_from_camera;
  carried.alignment.fit.unobserved = kNothingObserved;
  carried.alignment.information.diagonal() << Eigen::Vector3d::Constant(1 / (kCarriedTurn * kCarriedTurn)),
      Eigen::Vector3d::Constant(1 / (kCarriedShift * kCarriedShift));
  return carried;
}

void Tracker::leave_out_moving(const Surface& live, const Tracked& tracked, const Volume& volume) {
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
                              .most = most_moving(camera),
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
  return moving_[0] > most_moving(camera) ? 0.0
                                          : static_cast<double>(moving_[0]) / static_cast<double>(pixels_of(camera));
}

void Tracker::restart() {
  memory_.last.clear();
  memory_.lost_frames = memory_.lost_views = 0;
  reference_.clear();
  prediction_ = {};
}

void Tracker::begin_lost() {
  restart();
  const auto newest = recent();
  memory_.last = {{0, newest.empty() ? Eigen::Isometry3d::Identity() : *keyframes_[newest[0]].tracked_from_camera}};
  memory_.lost_frames = kStillThere + 1;
}

Tracker::Saved Tracker::save() const {
  return {.memory = memory_,
          .reference = reference_.save(),
          .prediction = raycaster_.save(prediction_),
          .gyroscope = gyroscope_.memory()};
}

void Tracker::restore(const Saved& saved) {
  memory_ = saved.memory;
  reference_.restore(saved.reference);
  prediction_ = raycaster_.restore(saved.prediction);
  gyroscope_.restore(saved.gyroscope);
}

void Tracker::learn_focal_length() {
  if (keyframes_.size() < 2 || !keyframes_[keyframes_.size() - 2].tracked_from_camera) return;
  const std::size_t seen = keyframes_.size() - 1, known = seen - 1;
  const Eigen::Isometry3d motion =
      keyframes_[known].tracked_from_camera->inverse() * *keyframes_[seen].tracked_from_camera;
  if (Eigen::AngleAxisd(motion.linear()).angle() < kFocalTurn) return;
  const auto costs = focal_costs(*images_.features(known), *images_.features(seen), rig_.depth);
  for (std::size_t i = 0; i < costs.size(); ++i) memory_.focal_costs[i] += costs[i];
  memory_.focal_pairs += !costs.empty();
}

void Tracker::commit(const Frame& frame, const Surface& live, const Tracked& tracked) {
  const Eigen::Isometry3d& pose = tracked.submap_from_camera;
  const Alignment* a = tracked.state == Tracked::State::aligned ? &tracked.alignment : nullptr;
  const ColourMoment moment = moment_of(frame, pose);
  if (a != nullptr && !a->clock_offset_costs.empty()) {
    for (std::size_t k = 0; k < kClockOffsets.size(); ++k) memory_.clock_offset_costs[k] += a->clock_offset_costs[k];
    ++memory_.clock_offset_frames;
  }
  if (!live.packed.empty() && (!reference_.is_set() || is_new_reference(reference_.submap_from_camera(), pose, a)))
    reference_.set(live, pose, moment);
  if (a != nullptr && a->fit.photometric_share > 0)
    memory_.usual_brightness += 0.1 * (a->fit.photometric_rmse - memory_.usual_brightness);
  if (a != nullptr && a->fit.unobserved == 0 && memory_.lost_frames == 0)
    gyroscope_.learn(memory_.last.back().timestamp, frame.timestamp,
                     Eigen::Quaterniond((memory_.last.back().submap_from_camera.inverse() * pose).linear()));
  gyroscope_.forget_before(frame.timestamp);
  if (a != nullptr && a->fit.unobserved == 0 && memory_.lost_frames == 0) judge_guess(frame, pose);
  memory_.last_guess = frame.guess;
  memory_.last_is_weak = a != nullptr && a->fit.unobserved > 0;
  if (a == nullptr || a->fit.unobserved < kNothingObserved) memory_.last_aligned = frame.timestamp;
  if (memory_.lost_frames > 0) memory_.last.clear();  // no velocity across a gap
  memory_.lost_frames = memory_.lost_views = 0;
  if (memory_.last.size() == 2) memory_.last.erase(memory_.last.begin());
  memory_.last.push_back({frame.timestamp, pose});
}

}  // namespace cairn
