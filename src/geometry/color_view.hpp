// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <vector>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Reprojects frames into the view of the color camera: its images, with depth per pixel. Used by stages that need
/// color at full resolution.
class ColorView {
 public:
  explicit ColorView(const Rig& rig);
  /// Reprojects depth into the color camera's pixels; the nearest surface wins. Frames of a rig with registered color
  /// stay unchanged. Any thread.
  [[nodiscard]] Frame operator()(Frame frame) const;
  /// Reverse direction: registers color to depth; each depth pixel samples the color image. Pixels occluded in the
  /// color camera are black. Any thread.
  [[nodiscard]] Frame on_depth(Frame frame) const;

 private:
  struct Projection;
  [[nodiscard]] std::vector<float> depth_of(const std::vector<Projection>& projections) const;
  [[nodiscard]] std::vector<Projection> project(const std::vector<float>& depth) const;

  Rig rig_;
  std::vector<Eigen::Vector2f> rays_;  // rays of the depth pixels, z = 1
};

}  // namespace cairn
