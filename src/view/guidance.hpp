// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Advice for the operator of the sensor, based on the tracking results.
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/options.hpp"
#include "cairn/mapping/reports.hpp"

namespace cairn {

/// Usability of a depth image as shares of its pixels, and brightness of the color image.
struct ImageContent {
  double near = 0;                   ///< pixels below the minimum depth, and holes beside pixels close to it
  double far = 0;                    ///< pixels beyond the maximum depth, and holes beside pixels close to it
  double empty = 0;                  ///< no depth
  double median = 0;                 ///< meters, of the measured depth; 0: none
  std::optional<double> brightness;  ///< mean, 0..1 of sRGB's range; empty without color
};
/// Samples every 8th pixel in both directions. Requires a frame without problem.
[[nodiscard]] ImageContent content_of(const Frame& frame, const Rig& rig, const SurfaceOptions& range);

/// In order of increasing urgency.
enum class Hint { good, covered, dark, side, weak, far, close, slow, back };
[[nodiscard]] const char* to_string(Hint hint);

struct Advice {
  Hint hint = Hint::good;
  std::string words;                    ///< short enough for a phone
  std::optional<Eigen::Vector2d> turn;  ///< direction to turn when lost, in the image: x right, y down; length 1
};

/// Selects a hint. Each hint has a measure, smoothed over frames, with hysteresis: it activates above one threshold and
/// deactivates below another. A hint remains for a minimum time unless a more urgent hint replaces it, so that it can
/// be read.
class Guidance {
 public:
  explicit Guidance(const Camera& depth, const SurfaceOptions& range = {});

  /// Adds a processed frame. `pose`: world_from_camera of a fused frame; `now`: seconds of a monotonic clock.
  void add_frame(const FrameReport& report, const ImageContent& content, const std::optional<Eigen::Isometry3d>& pose,
                 double now);
  /// Sets how well the visible surface has been observed, 0..1; see coverage_of.
  void set_coverage(double coverage) { coverage_ = coverage; }
  /// Adds frames dropped after the last frame because the computer was busy.
  void add_dropped(int frames);
  /// Current advice.
  [[nodiscard]] Advice advice() const;

 private:
  static constexpr std::size_t kHints = static_cast<std::size_t>(Hint::back) + 1;
  struct Measure {
    double value = 0;  // smoothed
    bool holds = false;
  };
  void measure(Hint hint, double value, double step);
  void update_motion(const FrameReport& report, const Eigen::Isometry3d& pose, double median);
  void select_hint(double now);

  Camera camera_;
  SurfaceOptions range_;
  std::array<Measure, kHints> measures_;
  double coverage_ = 0, median_ = 0;
  double processed_ratio_ = 1;  // share of the incoming frames that are processed, smoothed
  bool drops_frames_ = false;   // true if the motion is slow enough, but dropped frames make the steps too large
  double speed_ = 0;            // of the last frame, as a ratio to the limit of tracking
  Eigen::Vector2d flow_ = Eigen::Vector2d::Zero();  // image motion of the center point: tangent of the angle, 1/s
  std::optional<std::pair<double, Eigen::Isometry3d>> last_pose_;  // timestamp, world_from_camera
  std::optional<double> last_frame_time_, recovered_time_;         // `now` of the last frame; time of the last recovery
  std::optional<Eigen::Vector2d> turn_;
  bool is_starting_ = true;
  Hint shown_ = Hint::good;
  double shown_time_ = 0, now_ = 0;
};

}  // namespace cairn
