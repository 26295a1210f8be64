// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/tracker.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "map/frame_features.hpp"
#include "map/tracking_criteria.hpp"
#include "spirv/moving_mask.comp.h"

namespace cairn {
namespace {

constexpr int kClockOffsetFrames = 10;                                        // before they are believed
constexpr int kFocalPairs = 4;                                                // of views, before they are believed
constexpr double kFocalTurn = 0.1;                                            // radians between the two views of a pair
constexpr double kClockOffsetContrast = 1.5;                                  // of the worst fit to the best
constexpr std::size_t kRecentPlaces = 4, kMostSimilar = 6, kOtherPlaces = 4;  // compared with a frame
constexpr double kMaxMoving = 0.3;    // of the image; more is no person but a wrong pose or a sensor without use
constexpr double kEnoughDepth = 0.2;  // of the image, to begin a component with
constexpr double kLeastDepth = 0.02;  // of the image, to begin the map with: as much as alignment asks for

/// The first camera's pose in a world whose y axis points down.
Eigen::Isometry3d level(const std::optional<Eigen::Vector3d>& acceleration) {
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  if (acceleration && acceleration->norm() > 0)
    world_from_camera.linear() =
        Eigen::Quaterniond::FromTwoVectors(*acceleration, -Eigen::Vector3d::UnitY()).toRotationMatrix();
  return world_from_camera;
}

/// Share of the depth image that lies between two depths.
double share_between(const std::vector<float>& depth, float least, float most) {
  const auto seen = std::count_if(depth.begin(), depth.end(), [&](float z) { return z >= least && z <= most; });
  return static_cast<double>(seen) / static_cast<double>(depth.size());
}

/// Where a function sampled at evenly spaced places is lowest: on the parabola through the lowest sample and its
/// neighbours.
template <std::size_t N>
double lowest(const std::array<double, N>& at, const std::array<double, N>& values) {
  const auto best = static_cast<std::size_t>(std::min_element(values.begin(), values.end()) - values.begin());
  if (best == 0 || best + 1 == N) return at[best];
  const double before = values[best - 1], after = values[best + 1], curvature = before - 2 * values[best] + after;
  return at[best] + (curvature > 0 ? 0.5 * (before - after) / curvature : 0.0) * (at[1] - at[0]);
}

}  // namespace

Tracker::Tracker(gpu::Device& device, const Rig& rig, const Camera& rectified, const Options& options,
                 const KeyframeDatabase& keyframes)
    : device_(device),
      options_(options),
      rig_(rig),
      keyframes_(keyframes),
      raycaster_(device, rectified, options.surface, options.track.levels, options.track.finest_level),
      aligner_(device, options.track),
      reference_(device, rectified, options.track),
      moving_count_(device, 4),
      mask_(device, "moving_mask", moving_mask_comp) {}

/// Where the camera would be if it kept its velocity since the last two fused frames.
Eigen::Isometry3d Tracker::predict(double timestamp) const {
  const Moment& last = memory_.last.back();
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

double Tracker::clock_offset() const {
  if (memory_.clock_offset_frames < kClockOffsetFrames) return 0.0;
  const auto& costs = memory_.clock_offset_costs;
  const auto [least, most] = std::minmax_element(costs.begin(), costs.end());
  // Colour that is not registered to depth fits nowhere much better than elsewhere.
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
  for (const auto& candidate : keyframes_.query(seen, keyframes_.size()))
    if (keyframes_[candidate.entry].tracked_from_camera && chosen.size() < kMostSimilar)
      chosen.push_back(candidate.entry);
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

std::optional<Eigen::Isometry3d> Tracker::recognise(const Features& seen,
                                                    const std::vector<std::size_t>& keyframes) const {
  std::optional<Eigen::Isometry3d> guess;
  int most = 0;
  for (const std::size_t i : keyframes) {
    const auto located = solve_pnp(keyframes_[i].features, seen, rig_.depth);
    if (!located || located->inliers <= most) continue;
    most = located->inliers;
    guess = *keyframes_[i].tracked_from_camera * located->known_from_seen;
  }
  return guess;
}

Tracked Tracker::track(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  if (memory_.last.empty()) return begin_map(frame);
  Tracked tracked =
      memory_.lost_frames == 0 ? follow(frame, live, volume, times) : relocalise(frame, live, volume, times);
  tracked.cause = tracked.alignment.lost;
  tracked.reason = text_of(tracked.cause);
  if (tracked.alignment.converged()) {
    tracked.state = Tracked::State::aligned;
    tracked.submap_from_camera = tracked.alignment.submap_from_camera;
    tracked.moving = timed(times, "track", [&] { return leave_out_moving(live, tracked, volume); });
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

Tracked Tracker::begin_map(const Frame& frame) const {
  if (share_between(frame.depth, options_.surface.min_depth, options_.surface.max_depth) < kLeastDepth)
    return {.cause = FrameCause::too_little_depth,
            .reason = fmt::format("too little depth between {} and {} m to begin the map with",
                                  options_.surface.min_depth, options_.surface.max_depth)};
  return {.state = Tracked::State::begins, .submap_from_camera = level(frame.acceleration)};
}

bool Tracker::gives_up(const Frame& frame) {
  const auto seen = std::count_if(frame.depth.begin(), frame.depth.end(), [](float z) { return z > 0; });
  memory_.lost_views += static_cast<double>(seen) > kEnoughDepth * static_cast<double>(frame.depth.size());
  return memory_.lost_views >= options_.map.lost_frames;
}

/// Aligns the frame with the map as seen from the guess.
Tracked Tracker::align(const Frame& frame, const Surface& live, Volume& volume, const Eigen::Isometry3d& guess,
                       const char* name, Reach reach, StageTimes& times) {
  if (memory_.lost_frames > 0) volume.bring(guess.translation());
  prediction_ = timed(times, "raycast", [&] { return raycaster_.raycast(volume, guess); });
  return timed(times, "track", [&] {
    return Tracked{.alignment = aligner_.align(live, prediction_, guess, &reference_, moment_of(frame, guess), reach),
                   .guess = name,
                   .predicted_from = guess};
  });
}

/// The frame follows one that was fused: the camera goes on as before, stops, or is where corners say.
Tracked Tracker::follow(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  const Moment& last = memory_.last.back();
  const auto try_from = [&](const Eigen::Isometry3d& guess, const char* name, Reach reach = Reach::wide) {
    return align(frame, live, volume, guess, name, reach, times);
  };
  Tracked best = try_from(predict(frame.timestamp), "motion");
  if (!best.alignment.converged()) best = try_from(last.submap_from_camera, "still");  // the hand may have stopped
  if (is_doubtful(best.alignment, memory_.usual_brightness)) {
    if (const auto guess =
            timed(times, "recognise", [&] { return recognise(features_of(frame, live, rig_, device_), recent()); })) {
      if (Tracked other = try_from(*guess, "features"); is_better(other.alignment, best.alignment))
        best = std::move(other);
      // Something may move through the view: brightness then tells the still part's pose from the moving one's.
      if (Tracked other = try_from(*guess, "features", Reach::close); tells_apart(other.alignment, best.alignment))
        best = std::move(other);
    }
  }
  Alignment& a = best.alignment;
  if (!a.converged()) return best;
  if (!is_hand_motion(last.submap_from_camera.inverse() * a.submap_from_camera, frame.timestamp - last.timestamp))
    a.lost = FrameCause::too_fast;
  else if (misfit(a) > kMisfit)
    a.lost = FrameCause::poor_fit;
  return best;
}

/// The camera is lost: it is where it was last, or where corners say, if that is certain.
Tracked Tracker::relocalise(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  Tracked tracked = align(frame, live, volume, predict(frame.timestamp), "motion", Reach::wide, times);
  if (is_certain_in_place(tracked.alignment, memory_.lost_frames)) return tracked;
  const auto guess = timed(times, "recognise", [&] {
    const Features seen = features_of(frame, live, rig_, device_);
    return recognise(seen, candidates(seen));
  });
  if (guess)
    if (Tracked other = align(frame, live, volume, *guess, "relocalised", Reach::wide, times);
        is_certain(other.alignment))
      return other;
  if (tracked.alignment.converged()) tracked.alignment.lost = FrameCause::not_relocalised;
  return tracked;
}

double Tracker::leave_out_moving(const Surface& live, const Tracked& tracked, const Volume& volume) {
  if (!reference_.is_set() || live.packed.empty()) return 0;
  const Eigen::Isometry3d& submap_from_camera = tracked.submap_from_camera;
  // Another guess may have been tried since, and have been worse.
  if (prediction_.submap_from_camera.matrix() != tracked.predicted_from.matrix())
    prediction_ = raycaster_.raycast(volume, tracked.predicted_from);
  const auto level = static_cast<std::size_t>(options_.track.levels - 1);
  const Camera& camera = live.levels[level]->camera;
  const auto pixels = static_cast<std::uint32_t>(camera.width * camera.height);
  const auto mask = [&](std::uint32_t factor) {
    std::uint32_t count[1] = {0};
    gpu::Batch batch(device_);
    batch.fill(moving_count_, 0);
    mask_(batch, {pixels, 1, 1},
          {.camera = shader::pinhole(camera),
           .model_from_live = shader::rigid(prediction_.submap_from_camera.inverse() * submap_from_camera),
           .keyframe_from_live = shader::rigid(reference_.submap_from_camera().inverse() * submap_from_camera),
           .factor = factor,
           .full_width = static_cast<std::uint32_t>(live.levels[0]->camera.width)},
          {&live.levels[level]->points, &prediction_.levels[level]->points,
           &reference_.level(options_.track.levels - 1), live.packed[level], live.fusion, &moving_count_});
    batch.download(moving_count_, std::span<std::uint32_t>(count));
    batch.run();
    return static_cast<double>(count[0]) / pixels;
  };
  if (mask(0) > kMaxMoving) return 0;
  return mask(1u << level);
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

void Tracker::restore(const Memory& memory, const PhotometricKeyframe::Saved& reference) {
  memory_ = memory;
  reference_.restore(reference);
}

void Tracker::learn_focal_length() {
  if (keyframes_.size() < 2 || !keyframes_[keyframes_.size() - 2].tracked_from_camera) return;
  const DatabaseEntry &known = keyframes_[keyframes_.size() - 2], &seen = keyframes_[keyframes_.size() - 1];
  const Eigen::Isometry3d motion = known.tracked_from_camera->inverse() * *seen.tracked_from_camera;
  if (Eigen::AngleAxisd(motion.linear()).angle() < kFocalTurn) return;
  const auto costs = focal_costs(known.features, seen.features, rig_.depth);
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
  if (memory_.lost_frames > 0) memory_.last.clear();  // no velocity across a gap
  memory_.lost_frames = memory_.lost_views = 0;
  if (memory_.last.size() == 2) memory_.last.erase(memory_.last.begin());
  memory_.last.push_back({frame.timestamp, pose});
}

}  // namespace cairn
