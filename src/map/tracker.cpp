// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/tracker.hpp"

#include <algorithm>
#include <cmath>

#include "spirv/moving_mask.comp.h"

namespace cairn {
namespace {

constexpr int kClockOffsetFrames = 10;        // before they are believed
constexpr int kFocalPairs = 4;                // of views, before they are believed
constexpr double kFocalTurn = 0.1;            // radians between the two views of a pair
constexpr double kClockOffsetContrast = 1.5;  // of the worst fit to the best
// Of misfit: above the first another guess is tried, above the second the frame is not fused. Frames of hand-held
// Kinect recordings lie at 1.5 to 5; a pose 15 cm off gave 8.4.
constexpr double kDoubtful = 4.0, kMisfit = 7.0;
constexpr double kClearlyBetter = 0.8;              // times the cost of the guess from motion
constexpr double kDoubtfulBrightness = 0.1;         // photometric rmse, brightness in 0..1
constexpr double kSuddenly = 2.5;                   // times the usual photometric rmse
constexpr double kTellsApart = 0.5;                 // times the photometric rmse of another pose
constexpr double kUsualBrightness = 0.03;           // photometric rmse of hand-held Kinect recordings
constexpr double kMaxSpeed = 4.0, kMaxTurn = 12.0;  // metres and radians a second: a hand is slower
constexpr std::size_t kRecentPlaces = 4, kMostSimilar = 6, kOtherPlaces = 4;  // compared with a frame
// What a pose found after a loss must reach: a wrong one would be fused.
constexpr double kFoundInliers = 0.5, kFoundOverlap = 0.3, kFoundBrightness = 0.6, kFoundMisfit = 5.0;
// After so many lost frames, without brightness to tell, the camera may be anywhere: walls fit walls.
constexpr int kStillThere = 30;
constexpr double kMaxMoving = 0.3;          // of the image; more is no person but a wrong pose or a sensor without use
constexpr double kKeyframeTurn = 0.2;       // radians
constexpr double kKeyframeDistance = 0.15;  // metres
constexpr double kKeyframeShare = 0.5;      // of the points in both images that fit

/// Mean squared residual of the points that see the model, in variances of the depth noise; outliers count as 9.
double misfit(const Alignment& a) { return a.inlier_share * a.rmse * a.rmse + (1 - a.inlier_share) * 9; }

bool is_doubtful(const Alignment& a) {
  return !a.converged() || misfit(a) > kDoubtful || a.photometric_rmse > kDoubtfulBrightness;
}

/// Whether the frame fits clearly better at `a` than at `b`, by depth and by brightness.
bool is_better(const Alignment& a, const Alignment& b) {
  if (!a.converged() || !b.converged()) return a.converged();
  const bool compares_brightness = a.photometric_share > 0 && b.photometric_share > 0;
  const auto cost = [&](const Alignment& x) {
    const double brightness = compares_brightness ? x.photometric_rmse / kUsualBrightness : 0.0;
    return misfit(x) / x.overlap + brightness * brightness;
  };
  return cost(a) < kClearlyBetter * cost(b);
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

bool is_apart(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Isometry3d motion = a.inverse() * b;
  return motion.translation().norm() > kKeyframeDistance || Eigen::AngleAxisd(motion.linear()).angle() > kKeyframeTurn;
}

}  // namespace

Tracker::Tracker(gpu::Device& device, const Camera& camera, const Camera& rectified, const Options& options,
                 const KeyframeDatabase& places)
    : device_(device),
      options_(options.track),
      source_camera_(camera),
      database_(places),
      raycaster_(device, rectified, options.surface, options.track.levels, options.track.finest_level),
      aligner_(device, options.track),
      keyframe_(device, rectified, options.track),
      moving_count_(device, 4),
      mask_(device, "moving_mask", moving_mask_comp) {}

/// Where the camera would be if it kept its velocity since the last two accepted frames.
Eigen::Isometry3d Tracker::predict(double timestamp) const {
  const Moment& last = memory_.last.back();
  if (memory_.lost > 0 || memory_.last.size() < 2) return last.submap_from_camera;
  const double ratio = std::min((timestamp - last.timestamp) / (last.timestamp - memory_.last[0].timestamp), 2.0);
  return last.submap_from_camera *
         retract(ratio * local_coordinates(memory_.last[0].submap_from_camera.inverse() * last.submap_from_camera));
}

ColourMoment Tracker::moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const {
  ColourMoment moment{.stamp_delay = frame.colour_delay, .clock_offset = clock_offset()};
  if (memory_.last.empty() || memory_.lost > 0) return moment;
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
  for (const auto& candidate : database_.query(seen, database_.size()))
    if (database_[candidate.entry].is_here && chosen.size() < kMostSimilar) chosen.push_back(candidate.entry);
  for (std::size_t i = 0; i < database_.size(); ++i)
    if (database_[i].is_here) here.push_back(i);
  for (std::size_t k = 0; k < std::min(kOtherPlaces, here.size()); ++k)
    chosen.push_back(here[(static_cast<std::size_t>(memory_.lost) * kOtherPlaces + k) % here.size()]);
  return chosen;
}

std::vector<std::size_t> Tracker::recent() const {
  std::vector<std::size_t> recent;
  for (std::size_t i = database_.size(); i > 0 && recent.size() < kRecentPlaces; --i)
    if (database_[i - 1].is_here) recent.push_back(i - 1);
  return recent;
}

std::optional<Eigen::Isometry3d> Tracker::recognise(const Features& seen,
                                                    const std::vector<std::size_t>& places) const {
  std::optional<Eigen::Isometry3d> guess;
  int most = 0;
  for (const std::size_t i : places) {
    const auto located = solve_pnp(database_[i].features, seen, source_camera_);
    if (!located || located->inliers <= most) continue;
    most = located->inliers;
    guess = database_[i].submap_from_camera * located->known_from_seen;
  }
  return guess;
}

Tracked Tracker::operator()(const Frame& frame, const Surface& live, Volume& volume, StageTimes& times) {
  const auto align = [&](const Eigen::Isometry3d& guess, const char* name, Reach reach = Reach::wide) {
    if (memory_.lost > 0) volume.bring(guess.translation());
    model_ = timed(times, "raycast", [&] { return raycaster_.raycast(volume, guess); });
    return timed(times, "track", [&] {
      return Tracked{.alignment = aligner_.align(live, model_, guess, &keyframe_, moment_of(frame, guess), reach),
                     .guess = name,
                     .seen_from = guess};
    });
  };
  Tracked tracked = align(predict(frame.timestamp), "motion");
  if (memory_.lost == 0) {
    if (!tracked.alignment.converged())
      tracked = align(memory_.last.back().submap_from_camera, "still");  // the hand may have stopped
    if (is_doubtful(tracked.alignment) || tracked.alignment.photometric_rmse > kSuddenly * memory_.usual_brightness) {
      if (const auto guess = timed(times, "recognise", [&] {
            return recognise(extract_features(frame.colour, frame.depth, source_camera_), recent());
          })) {
        if (Tracked other = align(*guess, "features"); is_better(other.alignment, tracked.alignment))
          tracked = std::move(other);
        // Something may move through the view: brightness then tells the still part's pose from the moving one's.
        if (Tracked other = align(*guess, "features", Reach::close);
            is_better(other.alignment, tracked.alignment) &&
            other.alignment.photometric_rmse < kTellsApart * tracked.alignment.photometric_rmse)
          tracked = std::move(other);
      }
    }
    const Eigen::Isometry3d motion =
        memory_.last.back().submap_from_camera.inverse() * tracked.alignment.submap_from_camera;
    const double interval = frame.timestamp - memory_.last.back().timestamp;
    if (tracked.alignment.converged() && (motion.translation().norm() > kMaxSpeed * interval ||
                                          Eigen::AngleAxisd(motion.linear()).angle() > kMaxTurn * interval))
      tracked.alignment.lost = "no hand moves like that";
    else if (tracked.alignment.converged() && misfit(tracked.alignment) > kMisfit)
      tracked.alignment.lost = "the frame fits the map badly from every guess";
    return tracked;
  }

  const auto is_sure = [](const Alignment& a) {
    return a.converged() && a.inlier_share > kFoundInliers && a.overlap > kFoundOverlap && misfit(a) < kFoundMisfit &&
           a.unobserved == 0 &&
           (a.photometric_share == 0 ||
            (a.photometric_share > kFoundBrightness && a.photometric_rmse < kDoubtfulBrightness));
  };
  if (is_sure(tracked.alignment) && (memory_.lost <= kStillThere || tracked.alignment.photometric_share > 0))
    return tracked;
  const auto guess = timed(times, "recognise", [&] {
    const Features seen = extract_features(frame.colour, frame.depth, source_camera_);
    return recognise(seen, candidates(seen));
  });
  if (guess)
    if (Tracked other = align(*guess, "relocalised"); is_sure(other.alignment)) return other;
  if (tracked.alignment.converged()) tracked.alignment.lost = "not found again yet";
  return tracked;
}

double Tracker::leave_out_moving(const Surface& live, const Tracked& tracked, const Volume& volume) {
  if (!keyframe_.is_set() || live.packed.empty()) return 0;
  const Eigen::Isometry3d& submap_from_camera = tracked.alignment.submap_from_camera;
  // Another guess may have been tried since, and have been worse.
  if (model_.submap_from_camera.matrix() != tracked.seen_from.matrix())
    model_ = raycaster_.raycast(volume, tracked.seen_from);
  const auto level = static_cast<std::size_t>(options_.levels - 1);
  const Camera& camera = live.levels[level]->camera;
  const auto pixels = static_cast<std::uint32_t>(camera.width * camera.height);
  const auto mask = [&](std::uint32_t factor) {
    std::uint32_t count[1] = {0};
    gpu::Batch batch(device_);
    batch.fill(moving_count_, 0);
    mask_(batch, {pixels, 1, 1},
          {.camera = shader::pinhole(camera),
           .model_from_live = shader::rigid(model_.submap_from_camera.inverse() * submap_from_camera),
           .keyframe_from_live = shader::rigid(keyframe_.submap_from_camera().inverse() * submap_from_camera),
           .factor = factor,
           .full_width = static_cast<std::uint32_t>(live.levels[0]->camera.width)},
          {&live.levels[level]->points, &model_.levels[level]->points, &keyframe_.level(options_.levels - 1),
           live.packed[level], live.fusion, &moving_count_});
    batch.download(moving_count_, std::span<std::uint32_t>(count));
    batch.run();
    return static_cast<double>(count[0]) / pixels;
  };
  if (mask(0) > kMaxMoving) return 0;
  return mask(1u << level);
}

void Tracker::restart() {
  memory_.last.clear();
  memory_.lost = 0;
  keyframe_.clear();
  model_ = {};
}

void Tracker::begin_lost() {
  restart();
  const auto newest = recent();
  memory_.last = {{0, newest.empty() ? Eigen::Isometry3d::Identity() : database_[newest[0]].submap_from_camera}};
  memory_.lost = kStillThere + 1;
}

void Tracker::restore(const Memory& memory, const PhotometricKeyframe::Saved& keyframe) {
  memory_ = memory;
  keyframe_.restore(keyframe);
}

void Tracker::learn_from_places() {
  if (database_.size() < 2 || !database_[database_.size() - 2].is_here) return;
  const DatabaseEntry &known = database_[database_.size() - 2], &seen = database_[database_.size() - 1];
  const Eigen::Isometry3d motion = known.submap_from_camera.inverse() * seen.submap_from_camera;
  if (Eigen::AngleAxisd(motion.linear()).angle() < kFocalTurn) return;
  const auto costs = focal_costs(known.features, seen.features, source_camera_);
  for (std::size_t i = 0; i < costs.size(); ++i) memory_.focal_costs[i] += costs[i];
  memory_.focal_pairs += !costs.empty();
}

void Tracker::accept(const Frame& frame, const Surface& live, const Eigen::Isometry3d& submap_from_camera,
                     const Tracked* tracked) {
  const ColourMoment moment = moment_of(frame, submap_from_camera);
  if (tracked != nullptr && !tracked->alignment.clock_offset_costs.empty()) {
    for (std::size_t k = 0; k < kClockOffsets.size(); ++k)
      memory_.clock_offset_costs[k] += tracked->alignment.clock_offset_costs[k];
    ++memory_.clock_offset_frames;
  }
  const bool is_far = !keyframe_.is_set() || is_apart(keyframe_.submap_from_camera(), submap_from_camera) ||
                      (tracked != nullptr && tracked->alignment.photometric_share < kKeyframeShare);
  if (is_far && !live.packed.empty()) keyframe_.set(live, submap_from_camera, moment);
  if (tracked != nullptr && tracked->alignment.photometric_share > 0)
    memory_.usual_brightness += 0.1 * (tracked->alignment.photometric_rmse - memory_.usual_brightness);
  if (memory_.lost > 0) memory_.last.clear();  // no velocity across a gap
  memory_.lost = 0;
  if (memory_.last.size() == 2) memory_.last.erase(memory_.last.begin());
  memory_.last.push_back({frame.timestamp, submap_from_camera});
}

}  // namespace cairn
