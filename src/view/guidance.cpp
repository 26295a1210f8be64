// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/guidance.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "mapper/tracking_criteria.hpp"

namespace cairn {
namespace {

constexpr int kPixelStride = 8;                        // pixel stride in both directions
constexpr double kNearFactor = 1.5, kFarFactor = 0.8;  // factors on the minimum and maximum depth
constexpr double kDefaultDepth = 1.5;                  // meters, before the first measurement

// Steady scans rotate at 0.7 to 0.9 rad/s and move at 0.2 to 0.5 m/s (medians and 95 % of redkitchen and of TUM's
// fr1_xyz and fr2_desk); images of fr1_rpy, at 1.4 rad/s and more, have a blur of 10 to 20 pixels.
constexpr double kMaxTurnRate = 1.3, kMaxSpeed = 0.8;  // rad/s, m/s
constexpr double kMaxViewChange = 0.15;                // of the image's width, between fused frames

constexpr double kSmoothingTime = 0.4;         // smoothing time in seconds
constexpr double kCoveredSmoothingTime = 1.5;  // smoothing time for Hint::covered
constexpr double kFlowSmoothingTime = 0.3;     // smoothing time of the image motion
constexpr double kMinDisplayTime = 1.5;        // minimum display time of a hint in seconds
constexpr double kMinFlow = 0.05;              // minimum image motion for a turn direction: 3 degrees per second
constexpr double kMinInlierRatio = 0.45;
constexpr double kProcessedSmoothing = 0.3;  // smoothing step of processed_ratio_
constexpr double kMinNewBricks = 0.004;      // of the touched bricks
constexpr double kMinCoverage = 0.75;        // of the surface in view

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
      return {1 - kMinInlierRatio, 0.9 * (1 - kMinInlierRatio)};  // share of outliers
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
  const double near_limit = kNearFactor * range.min_depth, far_limit = kFarFactor * range.max_depth;
  ImageContent content;
  std::vector<float> measured;
  int pixels = 0, near = 0, far = 0;
  for (int v = kPixelStride / 2; v < depth.height; v += kPixelStride) {
    float last_depth = 0;  // last valid depth in the row
    int holes = 0;         // pixels before the first valid depth
    const auto count_holes = [&](int count) {
      near += last_depth > 0 && last_depth < near_limit ? count : 0;
      far += last_depth > far_limit ? count : 0;
    };
    for (int u = kPixelStride / 2; u < depth.width; u += kPixelStride, ++pixels) {
      const float z =
          frame
              .depth[static_cast<std::size_t>(v) * static_cast<std::size_t>(depth.width) + static_cast<std::size_t>(u)];
      if (z <= 0) {
        content.empty += 1;
        last_depth > 0 ? count_holes(1) : void(++holes);
        continue;
      }
      last_depth = z;
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
  if (!frame.color.empty()) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = kPixelStride / 2; i < frame.color.size(); i += kPixelStride * kPixelStride, ++count)
      sum += sample_brightness(frame.color[i]);
    content.brightness = sum / static_cast<double>(std::max<std::size_t>(count, 1));
  }
  return content;
}

const char* to_string(Hint hint) {
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

void Guidance::add_dropped(int frames) {
  processed_ratio_ += kProcessedSmoothing * (1.0 / (1 + std::max(0, frames)) - processed_ratio_);
}

/// Updates the speed and the image motion.
void Guidance::update_motion(const FrameReport& report, const Eigen::Isometry3d& pose, double median) {
  if (const auto before = std::exchange(last_pose_, std::pair(report.timestamp, pose))) {
    const double seconds = report.timestamp - before->first;
    if (seconds <= 0) return;
    const Eigen::Isometry3d now_from_before = pose.inverse() * before->second;
    const double turn = Eigen::AngleAxisd(now_from_before.linear()).angle() / seconds,
                 move = now_from_before.translation().norm() / seconds;
    const double hand_speed = std::max(turn / kMaxTurnRate, move / kMaxSpeed),
                 view = view_change(camera_, now_from_before) / kMaxViewChange;
    speed_ = std::max(hand_speed, view);
    drops_frames_ = std::max(hand_speed, processed_ratio_ * view) < thresholds_of(Hint::slow).off;
    const Eigen::Vector3d middle = now_from_before * Eigen::Vector3d(0, 0, median);
    if (middle.z() <= 0) return;
    flow_ += (1 - std::exp(-seconds / kFlowSmoothingTime)) * (middle.head<2>() / middle.z() / seconds - flow_);
  }
}

void Guidance::add_frame(const FrameReport& report, const ImageContent& content,
                         const std::optional<Eigen::Isometry3d>& pose, double now) {
  const double elapsed = last_frame_time_ ? now - *last_frame_time_ : 1e9;  // the first frame counts fully
  last_frame_time_ = now_ = now;
  const double step = 1 - std::exp(-elapsed / kSmoothingTime);
  if (content.median > 0) median_ = content.median;
  const double median = median_ > 0 ? median_ : kDefaultDepth;
  // An image without depth is too close or too far, depending on the last median.
  const bool has_no_depth = content.median <= 0, was_near = median < 2 * range_.min_depth;
  measure(Hint::close, has_no_depth && was_near ? 1 : content.near, step);
  measure(Hint::far, has_no_depth && !was_near ? 1 : content.far, step);
  if (content.brightness) measure(Hint::dark, 1 - *content.brightness, step);

  const bool is_lost = report.state == FrameState::lost,
             was_lost = measures_[static_cast<std::size_t>(Hint::back)].holds;
  if (is_lost && !was_lost) {
    turn_.reset();
    if (flow_.norm() > kMinFlow) turn_ = flow_.normalized();
    last_pose_.reset();
    flow_.setZero();
  }
  if (report.state != FrameState::skipped) measure(Hint::back, is_lost ? 1 : 0, 1);
  if (report.state == FrameState::fused) {
    if (was_lost) recovered_time_ = now;
    is_starting_ = report.fit.iterations == 0;
    if (pose) update_motion(report, *pose, median);
    measure(Hint::slow, speed_, step);
    measure(Hint::side, report.fit.unobserved > 0 ? 1 : 0, step);
    measure(Hint::weak, is_starting_ ? 0 : 1 - report.fit.inlier_share, step);
    const bool shows_new = report.new_bricks > kMinNewBricks * report.touched_bricks || coverage_ < kMinCoverage;
    measure(Hint::covered, shows_new || is_starting_ ? 0 : 1,
            last_frame_time_ ? 1 - std::exp(-std::min(elapsed, kCoveredSmoothingTime) / kCoveredSmoothingTime) : 0);
  }
  select_hint(now);
}

void Guidance::select_hint(double now) {
  auto urgent = Hint::good;
  for (std::size_t k = 0; k < kHints; ++k)
    if (measures_[k].holds) urgent = static_cast<Hint>(k);
  if (urgent == shown_ || (urgent < shown_ && shown_ != Hint::back && now - shown_time_ < kMinDisplayTime)) return;
  shown_ = urgent;
  shown_time_ = now;
}

Advice Guidance::advice() const {
  switch (shown_) {
    case Hint::good:
      if (is_starting_) return {shown_, "Hold still: the map begins", {}};
      return {
          shown_, recovered_time_ && now_ - *recovered_time_ < kMinDisplayTime ? "Found again" : "Tracking well", {}};
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
      return {shown_, drops_frames_ ? "Computer too slow: larger voxels help" : "Too fast: move slowly", {}};
    case Hint::back:
      return {shown_, turn_ ? std::string("Lost: turn back ") + side_of(*turn_) : "Lost: turn back", turn_};
  }
  return {};
}

}  // namespace cairn
