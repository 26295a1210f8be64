// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <vector>

#include "cairn/frame.hpp"

namespace cairn {

/// Frames as the colour camera sees them: its images, with the depth of what each pixel shows. What needs colour in all
/// its resolution works in this view.
class ColourView {
 public:
  explicit ColourView(const Rig& rig);
  /// Depth images lie in the colour camera's pixels; where two surfaces fall on one, the nearer is seen. A frame of a
  /// rig whose colour lies on depth is as it was. Any thread.
  [[nodiscard]] Frame operator()(Frame frame) const;
  /// The other way round: the depth camera's image, each of whose pixels has asked the colour image for what it shows.
  /// What something nearer hides from the colour camera is black. Any thread.
  [[nodiscard]] Frame on_depth(Frame frame) const;

 private:
  struct Seen;
  [[nodiscard]] std::vector<float> depth_of(const std::vector<Seen>& all) const;
  [[nodiscard]] std::vector<Seen> project(const std::vector<float>& depth) const;

  Rig rig_;
  std::vector<Eigen::Vector2f> rays_;  // at z = 1, of the depth pixels
};

}  // namespace cairn
