// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <optional>

#include "cairn/io/source.hpp"
#include "cairn/mapping/map.hpp"
#include "export/views.hpp"

namespace cairn {

/// Frame with its pose in the world of the map; `keyframe.image` is its pose in the map's trajectory.
struct PosedFrame {
  Frame frame;
  TextureKeyframe keyframe;
  double view_change = 0;  // from the first pose along the trajectory, in image widths
};

/// Frames of a recording with a color image and a pose of the map, in order.
class PosedFrames {
 public:
  /// `hold_out`: Frame::held_out of every N-th frame; 0: none.
  PosedFrames(const Map& map, const ViewsInput& input, std::unique_ptr<Source> recording, int hold_out);
  /// Next frame; nullopt at the end. Throws std::runtime_error for images of another size than the map's.
  [[nodiscard]] std::optional<PosedFrame> next();
  /// View change over the whole trajectory, in image widths.
  [[nodiscard]] double view_change() const { return view_changes_.empty() ? 0 : view_changes_.back(); }
  /// Camera of the color images.
  [[nodiscard]] const Camera& camera() const { return color_; }
  /// Number of poses.
  [[nodiscard]] std::size_t size() const { return poses_.size(); }

 private:
  [[nodiscard]] std::optional<std::size_t> pose_of(double timestamp) const;

  Camera color_, depth_;
  Trajectory poses_;  // by time of the depth image
  double clock_offset_;
  std::vector<double> view_changes_;  // by pose
  std::unique_ptr<Source> recording_;
};

/// Calls `visit` with the sharpest frame of each of at most `max_count` intervals of equal view change, without the
/// held-out frames, until it returns false. Memory: two frames.
void visit_sharpest(PosedFrames& frames, std::size_t max_count, const std::function<bool(PosedFrame)>& visit);

}  // namespace cairn
