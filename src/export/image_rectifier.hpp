// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <opencv2/core.hpp>
#include <optional>

#include "geometry/color_view.hpp"
#include "texture/views.hpp"

namespace cairn {

/// Frames of a map rectified to a pinhole camera of the color image's size, without borders.
class ImageRectifier {
 public:
  explicit ImageRectifier(const Rig& rig);
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// Color and depth in the pixels of camera(), and its pose as Frame::world_from_camera, at the time of the color
  /// image. Any thread.
  [[nodiscard]] Frame operator()(Frame frame, const Eigen::Isometry3d& world_from_map,
                                 const TextureKeyframe& keyframe) const;

 private:
  Camera lens_, camera_;
  Eigen::Isometry3d depth_from_color_;
  std::optional<ColorView> view_;  // where depth is not already in these pixels
  cv::Mat map_;                    // by pixel: position in the distorted image
};

}  // namespace cairn
