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
  std::vector<std::uint32_t> color;  // bytes R, G, B, 255
  std::vector<float> depth;          // of the map's surface, meters along z; 0: none
};

/// Pixel of a point, if it is inside the image and on the surface.
struct SeenPoint {
  Eigen::Vector2d pixel;
  double footprint;  // meters per pixel at the point
};
[[nodiscard]] std::optional<SeenPoint> seen_in(const TrainingView& view, const Eigen::Isometry3f& camera_from_world,
                                               const Eigen::Vector3f& point);

/// Bilinear color at a pixel, 0..1.
[[nodiscard]] Eigen::Vector3f color_at(const TrainingView& view, const Eigen::Vector2d& pixel);

}  // namespace cairn
