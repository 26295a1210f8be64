// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "track/tracker.hpp"

#include <algorithm>
#include <cmath>
namespace cairn {
namespace {

constexpr int kClockOffsetFrames = 10;        // before they are believed
constexpr double kClockOffsetContrast = 1.3;  // of the worst fit to the best
constexpr double kKeyframeTurn = 0.2;         // radians
constexpr double kKeyframeDistance = 0.15;    // metres
constexpr double kKeyframeShare = 0.5;        // of the points in both images that fit

}  // namespace

Tracker::Tracker(gpu::Device& device, const Camera& camera, const Options& options)
    : options_(options.track),
      raycast_(device, camera, options.surface, options.track.levels, options.track.finest_level),
      align_(device, options.track),
      keyframe_(device, camera, options.track) {}

/// Where the camera would be if it kept its velocity since the last two accepted frames.
Eigen::Isometry3d Tracker::predict(double timestamp) const {
  const Moment& last = last_.back();
  if (lost_ > 0 || last_.size() < 2) return last.submap_from_camera;
  const double ratio = std::min((timestamp - last.timestamp) / (last.timestamp - last_[0].timestamp), 2.0);
  return last.submap_from_camera *
         exponential(ratio * logarithm(last_[0].submap_from_camera.inverse() * last.submap_from_camera));
}

ColourMoment Tracker::moment_of(const Frame& frame, const Eigen::Isometry3d& submap_from_camera) const {
  ColourMoment moment{.stamp_delay = frame.colour_delay, .clock_offset = clock_offset()};
  if (last_.empty() || lost_ > 0) return moment;
  const double interval = frame.timestamp - last_.back().timestamp;
  moment.velocity = logarithm(last_.back().submap_from_camera.inverse() * submap_from_camera) / interval;
  return moment;
}

double Tracker::clock_offset() const {
  if (clock_offset_frames_ < kClockOffsetFrames) return 0.0;
  const auto& costs = clock_offset_costs_;
  const auto best = static_cast<std::size_t>(std::min_element(costs.begin(), costs.end()) - costs.begin());
  // Colour that is not registered to depth fits nowhere much better than elsewhere.
  if (*std::max_element(costs.begin(), costs.end()) < kClockOffsetContrast * costs[best]) return 0.0;
  if (best == 0 || best + 1 == costs.size()) return kClockOffsets[best];
  // The lowest point of the parabola through the best candidate and its neighbours.
  const double before = costs[best - 1], after = costs[best + 1];
  const double curvature = before - 2 * costs[best] + after;
  const double shift = curvature > 0 ? 0.5 * (before - after) / curvature : 0.0;
  return kClockOffsets[best] + shift * (kClockOffsets[1] - kClockOffsets[0]);
}

Tracked Tracker::operator()(const Frame& frame, const Surface& live, const Volume& volume, StageTimes& times) {
  const auto align = [&](const Eigen::Isometry3d& guess) {
    const ModelView model = timed(times, "raycast", [&] { return raycast_(volume, guess); });
    return timed(times, "track", [&] { return align_(live, model, guess, &keyframe_, moment_of(frame, guess)); });
  };
  Tracked tracked{.alignment = align(predict(frame.timestamp)), .guess = "motion"};
  if (!tracked.alignment.converged() && lost_ == 0)  // the hand may have stopped
    tracked = {.alignment = align(last_.back().submap_from_camera), .guess = "still"};
  return tracked;
}

void Tracker::accept(const Frame& frame, const Surface& live, const Eigen::Isometry3d& submap_from_camera,
                     const Tracked* tracked) {
  const ColourMoment moment = moment_of(frame, submap_from_camera);
  if (tracked != nullptr && !tracked->alignment.clock_offset_costs.empty()) {
    for (std::size_t k = 0; k < kClockOffsets.size(); ++k)
      clock_offset_costs_[k] += tracked->alignment.clock_offset_costs[k];
    ++clock_offset_frames_;
  }
  if (!live.packed.empty()) {
    const Eigen::Isometry3d motion = keyframe_.submap_from_camera().inverse() * submap_from_camera;
    if (!keyframe_.is_set() || motion.translation().norm() > kKeyframeDistance ||
        Eigen::AngleAxisd(motion.linear()).angle() > kKeyframeTurn ||
        (tracked != nullptr && tracked->alignment.photometric_share < kKeyframeShare))
      keyframe_.set(live, submap_from_camera, moment);
  }
  lost_ = 0;
  if (last_.size() == 2) last_.erase(last_.begin());
  last_.push_back({frame.timestamp, submap_from_camera});
}

}  // namespace cairn
