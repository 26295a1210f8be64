// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/guidance.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "map/tracking_criteria.hpp"

namespace cairn {
namespace {

constexpr int kEvery = 8;                              // pixel stride in both directions
constexpr double kNearlyNear = 1.5, kNearlyFar = 0.8;  // factors on the minimum and maximum depth
constexpr double kDefaultDepth = 1.5;                  // meters, before the first measurement

// Steady scans rotate at 0.7 to 0.9 rad/s and move at 0.2 to 0.5 m/s (medians and 95 % of redkitchen and of TUM's
// fr1_xyz and fr2_desk); images of fr1_rpy, at 1.4 rad/s and more, have a blur of 10 to 20 pixels.
constexpr double kFastTurn = 1.3, kFastMove = 0.8;  // rad/s, m/s
constexpr double kFastView = 0.15;                  // of the image's width, between fused frames

constexpr double kSmooth = 0.4;      // smoothing time in seconds
constexpr double kSettled = 1.5;     // smoothing time for Hint::covered
constexpr double kFlowOver = 0.3;    // smoothing time of the image motion
constexpr double kStay = 1.5;        // minimum display time of a hint in seconds
constexpr double kLeastFlow = 0.05;  // minimum image motion for a turn direction: 3 degrees per second
constexpr double kFewInliers = 0.45;
constexpr double kKeptStep = 0.3;        // smoothing step of kept_
constexpr double kFewNewBricks = 0.004;  // of the touched bricks
constexpr double kWellCovered = 0.75;    // of the surface in view

struct Thresholds {
  double on, off;
};
/// Thresholds on a hint's measure.
Thresholds thresholds_of(Hint hint) {
  switch (hint) {
    case Hint::good:
      break;
    case Hint::covered:
      return {0.9, 0.4};  // share of the frames without new surface
    case Hint::dark:
      return {0.92, 0.89};  // 1 - brightness: below 20 of 255
    case Hint::side:
      return {0.5, 0.2};  // share of the frames with an unobserved direction
    case Hint::weak:
      return {1 - kFewInliers, 0.9 * (1 - kFewInliers)};  // share of outliers
    case Hint::far:
      return {0.5, 0.35};  // of the image
    case Hint::close:
      return {0.3, 0.2};  // of the image
    case Hint::slow:
      return {1, 0.8};  // ratio to the speed limit of tracking
    case Hint::back:
      return {0.5, 0.5};  // lost or not: not smoothed
  }
  return {2, 2};
}

double sample_brightness(std::uint32_t pixel) {
  return static_cast<double>((pixel & 0xff) + 2 * (pixel >> 8 & 0xff) + (pixel >> 16 & 0xff)) / (4 * 255.0);
}

/// Dominant side of the image for a direction.
const char* side_of(const Eigen::Vector2d& turn) {
  if (std::abs(turn.x()) > std::abs(turn.y())) return turn.x() < 0 ? "left" : "right";
  return turn.y() < 0 ? "up" : "down";
}

}  // namespace

ImageContent content_of(const Frame& frame, const Rig& rig, const SurfaceOptions& range) {
  const Camera& depth = rig.depth;
  const double nearly_near = kNearlyNear * range.min_depth, nearly_far = kNearlyFar * range.max_depth;
  ImageContent content;
  std::vector<float> measured;
  int pixels = 0, near = 0, far = 0;
  for (int v = kEvery / 2; v < depth.height; v += kEvery) {
    float beside = 0;  // last valid depth in the row
    int holes = 0;     // pixels before the first valid depth
    const auto count_holes = [&](int count) {
      near += beside > 0 && beside < nearly_near ? count : 0;
      far += beside > nearly_far ? count : 0;
    };
    for (int u = kEvery / 2; u < depth.width; u += kEvery, ++pixels) {
      const float z =
          frame
              .depth[static_cast<std::size_t>(v) * static_cast<std::size_t>(depth.width) + static_cast<std::size_t>(u)];
      if (z <= 0) {
        content.empty += 1;
        beside > 0 ? count_holes(1) : void(++holes);
        continue;
      }
      beside = z;
      count_holes(std::exchange(holes, 0));
      near += z < range.min_depth;
      far += z > range.max_depth;
      measured.push_back(z);
    }
  }
  const double all = std::max(pixels, 1);
  content.near = near / all;
  content.far = far / all;
  content.empty /= all;
  if (!measured.empty()) {
    const auto middle = measured.begin() + static_cast<std::ptrdiff_t>(measured.size() / 2);
    std::nth_element(measured.begin(), middle, measured.end());
    content.median = *middle;
  }
  if (!frame.colour.empty()) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = kEvery / 2; i < frame.colour.size(); i += kEvery * kEvery, ++count)
      sum += sample_brightness(frame.colour[i]);
    content.brightness = sum / static_cast<double>(std::max<std::size_t>(count, 1));
  }
  return content;
}

const char* name_of(Hint hint) {
  static constexpr const char* kNames[] = {"good", "covered", "dark", "side", "weak", "far", "close", "slow", "back"};
  return kNames[static_cast<int>(hint)];
}

Guidance::Guidance(const Camera& depth, const SurfaceOptions& range) : camera_(depth), range_(range) {}

/// `step`: weight of the new value, 0..1.
void Guidance::measure(Hint hint, double value, double step) {
  Measure& m = measures_[static_cast<std::size_t>(hint)];
  m.value += step * (value - m.value);
  const auto [on, off] = thresholds_of(hint);
  m.holds = m.value >= (m.holds ? off : on);
}

void Guidance::leave_out(int frames) { kept_ += kKeptStep * (1.0 / (1 + std::max(0, frames)) - kept_); }

/// Updates the speed and the image motion.
void Guidance::follow(const FrameReport& report, const Eigen::Isometry3d& pose, double median) {
  if (const auto before = std::exchange(last_pose_, std::pair(report.timestamp, pose))) {
    const double seconds = report.timestamp - before->first;
    if (seconds <= 0) return;
    const Eigen::Isometry3d now_from_before = pose.inverse() * before->second;
    const double turn = Eigen::AngleAxisd(now_from_before.linear()).angle() / seconds,
                 move = now_from_before.translation().norm() / seconds;
    const double hand = std::max(turn / kFastTurn, move / kFastMove),
                 view = view_change(camera_, now_from_before) / kFastView;
    speed_ = std::max(hand, view);
    is_behind_ = std::max(hand, kept_ * view) < thresholds_of(Hint::slow).off;
    const Eigen::Vector3d middle = now_from_before * Eigen::Vector3d(0, 0, median);
    if (middle.z() <= 0) return;
    flow_ += (1 - std::exp(-seconds / kFlowOver)) * (middle.head<2>() / middle.z() / seconds - flow_);
  }
}

void Guidance::see(const FrameReport& report, const ImageContent& content, const std::optional<Eigen::Isometry3d>& pose,
                   double now) {
  const double passed = seen_ ? now - *seen_ : 1e9;  // the first frame counts fully
  seen_ = now_ = now;
  const double step = 1 - std::exp(-passed / kSmooth);
  if (content.median > 0) median_ = content.median;
  const double median = median_ > 0 ? median_ : kDefaultDepth;
  // An image without depth is too close or too far, depending on the last median.
  const bool is_blank = content.median <= 0, was_near = median < 2 * range_.min_depth;
  measure(Hint::close, is_blank && was_near ? 1 : content.near, step);
  measure(Hint::far, is_blank && !was_near ? 1 : content.far, step);
  if (content.brightness) measure(Hint::dark, 1 - *content.brightness, step);

  const bool is_lost = report.state == FrameState::lost,
             was_lost = measures_[static_cast<std::size_t>(Hint::back)].holds;
  if (is_lost && !was_lost) {
    turn_.reset();
    if (flow_.norm() > kLeastFlow) turn_ = flow_.normalized();
    last_pose_.reset();
    flow_.setZero();
  }
  if (report.state != FrameState::skipped) measure(Hint::back, is_lost ? 1 : 0, 1);
  if (report.state == FrameState::fused) {
    if (was_lost) found_ = now;
    begins_ = report.fit.iterations == 0;
    if (pose) follow(report, *pose, median);
    measure(Hint::slow, speed_, step);
    measure(Hint::side, report.fit.unobserved > 0 ? 1 : 0, step);
    measure(Hint::weak, begins_ ? 0 : 1 - report.fit.inlier_share, step);
    const bool shows_new = report.new_bricks > kFewNewBricks * report.touched_bricks || coverage_ < kWellCovered;
    measure(Hint::covered, shows_new || begins_ ? 0 : 1,
            seen_ ? 1 - std::exp(-std::min(passed, kSettled) / kSettled) : 0);
  }
  choose(now);
}

void Guidance::choose(double now) {
  auto most = Hint::good;
  for (std::size_t k = 0; k < kHints; ++k)
    if (measures_[k].holds) most = static_cast<Hint>(k);
  if (most == shown_ || (most < shown_ && shown_ != Hint::back && now - shown_since_ < kStay)) return;
  shown_ = most;
  shown_since_ = now;
}

Advice Guidance::advice() const {
  switch (shown_) {
    case Hint::good:
      if (begins_) return {shown_, "Hold still: the map begins", {}};
      return {shown_, found_ && now_ - *found_ < kStay ? "Found again" : "Tracking well", {}};
    case Hint::covered:
      return {shown_, "Seen well here: move on", {}};
    case Hint::dark:
      return {shown_, "Dark: more light helps", {}};
    case Hint::side:
      return {shown_, "Bare wall: move sideways", {}};
    case Hint::weak:
      return {shown_, "Tracking is weak: move slowly", {}};
    case Hint::far:
      return {shown_, "Too far: step closer", {}};
    case Hint::close:
      return {shown_, "Too close: step back", {}};
    case Hint::slow:
      return {shown_, is_behind_ ? "Computer too slow: larger voxels help" : "Too fast: move slowly", {}};
    case Hint::back:
      return {shown_, turn_ ? std::string("Lost: turn back ") + side_of(*turn_) : "Lost: turn back", turn_};
  }
  return {};
}

}  // namespace cairn
