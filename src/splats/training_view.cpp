// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/training_view.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace cairn {
namespace {

constexpr float kDepthTolerance = 0.03f;  // meters between a point and the surface of a view, per meter beyond 1 m

Eigen::Vector3f channels(std::uint32_t word) {
  return Eigen::Vector3f(static_cast<float>(word & 255), static_cast<float>(word >> 8 & 255),
                         static_cast<float>(word >> 16 & 255)) /
         255.0f;
}

}  // namespace

std::optional<SeenPoint> seen_in(const TrainingView& view, const Eigen::Isometry3f& camera_from_world,
                                 const Eigen::Vector3f& point) {
  const Eigen::Vector3f p = camera_from_world * point;
  if (p.z() < 0.05f) return std::nullopt;
  const Camera& c = view.camera;
  const Eigen::Vector2d pixel = c.project(p.cast<double>());
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= c.width - 1 && pixel.y() <= c.height - 1)) return std::nullopt;
  const auto nearest = static_cast<std::size_t>(std::lround(pixel.y())) * static_cast<std::size_t>(c.width) +
                       static_cast<std::size_t>(std::lround(pixel.x()));
  const float surface = view.depth[nearest];
  if (surface == 0 || std::abs(surface - p.z()) > kDepthTolerance * std::max(1.0f, p.z())) return std::nullopt;
  return SeenPoint{.pixel = pixel, .footprint = static_cast<double>(p.z()) / c.fx};
}

Eigen::Vector3f color_at(const TrainingView& view, const Eigen::Vector2d& pixel) {
  const int x = std::clamp(static_cast<int>(pixel.x()), 0, view.camera.width - 2),
            y = std::clamp(static_cast<int>(pixel.y()), 0, view.camera.height - 2);
  const auto u = static_cast<float>(pixel.x() - x), v = static_cast<float>(pixel.y() - y);
  const auto at = [&](int i, int j) {
    return channels(view.color[static_cast<std::size_t>(j) * static_cast<std::size_t>(view.camera.width) +
                               static_cast<std::size_t>(i)]);
  };
  return (1 - v) * ((1 - u) * at(x, y) + u * at(x + 1, y)) + v * ((1 - u) * at(x, y + 1) + u * at(x + 1, y + 1));
}

}  // namespace cairn
