// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What the person who holds the sensor should do, told from what became of the frames.
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "cairn/frame.hpp"
#include "cairn/options.hpp"
#include "cairn/reports.hpp"

namespace cairn {

/// What a depth image is good for, as shares of its pixels, and how bright the colour image is.
struct ImageContent {
  double near = 0;    ///< nearer than the sensor measures: depth below the least, and holes beside what is nearly so
  double far = 0;     ///< farther than is fused: depth above the most, and holes beside what is nearly so
  double empty = 0;   ///< no depth
  double median = 0;  ///< metres, of the measured depth; 0: none
  std::optional<double> brightness;  ///< mean, 0..1 of sRGB's range; nothing without colour
};
/// Looks at every 8th pixel each way. The frame has no problem.
[[nodiscard]] ImageContent content_of(const Frame& frame, const Rig& rig, const SurfaceOptions& range);

/// In the order of their urgency.
enum class Hint { good, covered, dark, side, weak, far, close, slow, back };
[[nodiscard]] const char* name_of(Hint hint);

struct Advice {
  Hint hint = Hint::good;
  std::string words;  ///< short enough for a phone
  std::optional<Eigen::Vector2d>
      turn;  ///< where to turn when lost: a direction in the image, x right, y down; length 1
};

/// Each hint has a measure, smoothed over frames, and two thresholds: it begins to hold above the one and ends below
/// the other. A hint stays for a while unless a more urgent one comes, so that words can be read.
class Guidance {
 public:
  explicit Guidance(const Camera& depth, const SurfaceOptions& range = {});

  /// A frame that was added to the map. `pose`: world_from_camera, of one that was fused; `now`: seconds, of any clock
  /// that goes on.
  void see(const FrameReport& report, const ImageContent& content, const std::optional<Eigen::Isometry3d>& pose,
           double now);
  /// How well the surface in view has been seen so far, 0..1; see coverage_of.
  void cover(double coverage) { coverage_ = coverage; }
  /// Frames that were left out after the last one, since the computer was busy with it.
  void leave_out(int frames);
  /// What to show.
  [[nodiscard]] Advice advice() const;

 private:
  static constexpr std::size_t kHints = static_cast<std::size_t>(Hint::back) + 1;
  struct Measure {
    double value = 0;  // smoothed
    bool holds = false;
  };
  void measure(Hint hint, double value, double step);
  void follow(const FrameReport& report, const Eigen::Isometry3d& pose, double median);
  void choose(double now);

  Camera camera_;
  SurfaceOptions range_;
  std::array<Measure, kHints> measures_;
  double coverage_ = 0, median_ = 0;
  double kept_ = 1;         // of the frames that come, smoothed
  bool is_behind_ = false;  // a hand is not too fast; the computer, which leaves out frames, is too slow
  double speed_ = 0;        // as a share of what tracking follows; of the last frame
  Eigen::Vector2d flow_ = Eigen::Vector2d::Zero();  // where what was in the middle goes: tangent of the angle, 1/s
  std::optional<std::pair<double, Eigen::Isometry3d>> last_pose_;  // timestamp, world_from_camera
  std::optional<double> seen_, found_;                             // now, of the last frame; when it was found again
  std::optional<Eigen::Vector2d> turn_;
  bool begins_ = true;
  Hint shown_ = Hint::good;
  double shown_since_ = 0, now_ = 0;
};

}  // namespace cairn
