// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "splats/rasterizer.hpp"

namespace cairn {

/// Image to learn from, rectified.
struct TrainingView {
  Camera camera;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  std::vector<std::uint32_t> color;                // bytes R, G, B, 255
  std::vector<float> depth;                        // of the map's surface, meters along z; 0: none
  Eigen::Vector3f gain = Eigen::Vector3f::Ones();  // exposure: the image's colors relative to those of the splats
};

/// Camera of an image resized by `scale`, at least 16 x 16 pixels.
[[nodiscard]] Camera scaled(const Camera& camera, double scale);

/// View of half the size: mean colors; mean depth of the pixels with a surface, 0 if there is none.
[[nodiscard]] TrainingView halved(const TrainingView& view);

/// Pixel of a point, if it is inside the image and on the surface.
struct SeenPoint {
  Eigen::Vector2d pixel;
  double footprint;  // meters per pixel at the point
};
[[nodiscard]] std::optional<SeenPoint> seen_in(const TrainingView& view, const Eigen::Isometry3f& camera_from_world,
                                               const Eigen::Vector3f& point);

[[nodiscard]] std::vector<Eigen::Isometry3f> camera_from_world(const std::vector<TrainingView>& views);

/// Bilinear color at a pixel, 0..1, without the view's gain.
[[nodiscard]] Eigen::Vector3f color_at(const TrainingView& view, const Eigen::Vector2d& pixel);

}  // namespace cairn
