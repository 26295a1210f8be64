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

Camera scaled(const Camera& camera, double scale) {
  Camera c = camera;
  c.width = std::max(16, static_cast<int>(std::lround(scale * camera.width)));
  c.height = std::max(16, static_cast<int>(std::lround(scale * camera.height)));
  const double x = static_cast<double>(c.width) / camera.width, y = static_cast<double>(c.height) / camera.height;
  c.fx *= x, c.fy *= y;
  c.cx = (camera.cx + 0.5) * x - 0.5, c.cy = (camera.cy + 0.5) * y - 0.5;
  return c;
}

TrainingView halved(const TrainingView& view) {
  TrainingView half{.camera = view.camera, .world_from_camera = view.world_from_camera, .color = {}, .depth = {}};
  half.gain = view.gain;
  Camera& c = half.camera;
  c.width /= 2, c.height /= 2;  // an odd last column or row is cut off
  c.fx *= 0.5, c.fy *= 0.5;
  c.cx = 0.5 * (c.cx + 0.5) - 0.5, c.cy = 0.5 * (c.cy + 0.5) - 0.5;
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      Eigen::Array3i sum(2, 2, 2);  // to round
      float depth = 0;
      int count = 0;
      for (int k = 0; k < 4; ++k) {
        const auto i = static_cast<std::size_t>(2 * y + k / 2) * static_cast<std::size_t>(view.camera.width) +
                       static_cast<std::size_t>(2 * x + k % 2);
        const auto word = static_cast<int>(view.color[i] & 0xffffffu);
        sum += Eigen::Array3i(word & 255, word >> 8 & 255, word >> 16);
        depth += view.depth[i];
        count += view.depth[i] > 0;
      }
      sum /= 4;
      half.color.push_back(0xff000000u | static_cast<std::uint32_t>(sum[0] | sum[1] << 8 | sum[2] << 16));
      half.depth.push_back(count > 0 ? depth / static_cast<float>(count) : 0.0f);
    }
  return half;
}

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

std::vector<Eigen::Isometry3f> camera_from_world(const std::vector<TrainingView>& views) {
  std::vector<Eigen::Isometry3f> poses;
  poses.reserve(views.size());
  for (const TrainingView& view : views) poses.emplace_back(view.world_from_camera.inverse().cast<float>());
  return poses;
}

Eigen::Vector3f color_at(const TrainingView& view, const Eigen::Vector2d& pixel) {
  const int x = std::clamp(static_cast<int>(pixel.x()), 0, view.camera.width - 2),
            y = std::clamp(static_cast<int>(pixel.y()), 0, view.camera.height - 2);
  const auto u = static_cast<float>(pixel.x() - x), v = static_cast<float>(pixel.y() - y);
  const auto at = [&](int i, int j) {
    return channels(view.color[static_cast<std::size_t>(j) * static_cast<std::size_t>(view.camera.width) +
                               static_cast<std::size_t>(i)]);
  };
  const Eigen::Vector3f color =
      (1 - v) * ((1 - u) * at(x, y) + u * at(x + 1, y)) + v * ((1 - u) * at(x, y + 1) + u * at(x + 1, y + 1));
  return color.cwiseQuotient(view.gain);
}

}  // namespace cairn
