// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "geometry/color_view.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn {
namespace {

constexpr float kJump = 0.05f;          // fraction of the depth: larger differences between neighbors are depth jumps
constexpr float kMaxFootprint = 16;     // maximum footprint of a depth pixel in color pixels, to each side
constexpr float kUnknownDepth = 2;      // meters, assumed to sample color at pixels without depth
constexpr float kMinOcclusion = 0.03f;  // meters: minimum depth difference of an occluder, in addition to the noise

/// Mean color over the footprint of a depth pixel, `side` color pixels wide, weighted by coverage.
std::uint32_t mean_around(const std::vector<std::uint32_t>& color, const Camera& c, float u, float v, int side) {
  const float reach = 0.5f * static_cast<float>(side);
  Eigen::Array3f sum = Eigen::Array3f::Zero();
  float total_weight = 0;
  const auto coverage = [&](int at, float middle) {
    return std::max(0.0f, std::min(static_cast<float>(at) + 0.5f, middle + reach) -
                              std::max(static_cast<float>(at) - 0.5f, middle - reach));
  };
  const auto around = [&](float middle, int count) {  // range of pixels that may be covered
    return std::pair{std::max(static_cast<int>(std::floor(middle - reach)), 0),
                     std::min(static_cast<int>(std::ceil(middle + reach)), count - 1)};
  };
  const auto [left, right] = around(u, c.width);
  const auto [top, bottom] = around(v, c.height);
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const float weight = coverage(x, u) * coverage(y, v);
      const std::uint32_t p =
          color[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x)];
      sum += weight * Eigen::Array3f(static_cast<float>(p & 255u), static_cast<float>(p >> 8 & 255u),
                                     static_cast<float>(p >> 16 & 255u));
      total_weight += weight;
    }
  const Eigen::Array3<std::uint32_t> bytes = (sum / total_weight + 0.5f).cast<std::uint32_t>();
  return bytes[0] | bytes[1] << 8 | bytes[2] << 16 | 0xff000000u;
}

}  // namespace

ColorView::ColorView(const Rig& rig) : rig_(rig) {
  if (!rig.color) return;
  for (int y = 0; y < rig.depth.height; ++y)
    for (int x = 0; x < rig.depth.width; ++x) rays_.emplace_back(rig.depth.undistorted_ray(x, y).cast<float>());
}

/// Projection of a depth pixel's point into the color camera.
struct ColorView::Projection {
  float u, v, z;  // pixels, meters; z = 0: not visible
};

std::vector<ColorView::Projection> ColorView::project(const std::vector<float>& depth) const {
  const Camera& c = rig_.color->camera;
  const Eigen::Isometry3f color_from_depth = rig_.color->color_from_depth.cast<float>();
  const double max_ray = c.widest_ray();
  std::vector<Projection> projections(depth.size(), Projection{0, 0, 0});
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (depth[i] <= 0) continue;
    const Eigen::Vector3f p = color_from_depth * (depth[i] * rays_[i].homogeneous());
    if (p.z() <= 0) continue;
    const Eigen::Vector2d ray = p.head<2>().cast<double>() / static_cast<double>(p.z());
    if (ray.norm() > max_ray) continue;
    const Eigen::Vector2d distorted = c.distort(ray);
    projections[i] = {static_cast<float>(c.fx * distorted.x() + c.cx), static_cast<float>(c.fy * distorted.y() + c.cy),
                      p.z()};
  }
  return projections;
}

std::vector<float> ColorView::depth_of(const std::vector<Projection>& projections) const {
  const Camera& c = rig_.color->camera;
  const int width = rig_.depth.width, height = rig_.depth.height;
  const auto min_reach =
      static_cast<float>(0.5 * std::max(c.fx / rig_.depth.fx, 1.0));  // pixels, for a fronto-parallel surface
  std::vector<float> depth(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height), 0.0f);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Projection& s = projections[static_cast<std::size_t>(y * width + x)];
      if (s.z == 0) continue;
      // The footprint extends halfway to the neighbors on the same surface.
      Eigen::Array4f reach = Eigen::Array4f::Constant(min_reach);  // left, right, up, down
      for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        if (x + dx < 0 || x + dx >= width || y + dy < 0 || y + dy >= height) continue;
        const Projection& other = projections[static_cast<std::size_t>((y + dy) * width + x + dx)];
        if (other.z == 0 || std::abs(other.z - s.z) > kJump * s.z) continue;
        const float u = 0.5f * (other.u - s.u), v = 0.5f * (other.v - s.v);
        reach = reach.max(Eigen::Array4f(-u, u, -v, v));
      }
      if (!(s.u > -kMaxFootprint && s.v > -kMaxFootprint && s.u < static_cast<float>(c.width) + kMaxFootprint &&
            s.v < static_cast<float>(c.height) + kMaxFootprint))
        continue;
      reach = reach.min(kMaxFootprint);
      const int left = std::max(static_cast<int>(std::ceil(s.u - reach[0])), 0),
                right = std::min(static_cast<int>(std::floor(s.u + reach[1])), c.width - 1),
                top = std::max(static_cast<int>(std::ceil(s.v - reach[2])), 0),
                bottom = std::min(static_cast<int>(std::floor(s.v + reach[3])), c.height - 1);
      for (int row = top; row <= bottom; ++row)
        for (int column = left; column <= right; ++column) {
          float& nearest = depth[static_cast<std::size_t>(row) * static_cast<std::size_t>(c.width) +
                                 static_cast<std::size_t>(column)];
          if (nearest == 0 || s.z < nearest) nearest = s.z;
        }
    }
  return depth;
}

Frame ColorView::operator()(Frame frame) const {
  if (rig_.color && frame.depth.size() == rays_.size()) frame.depth = depth_of(project(frame.depth));
  return frame;
}

Frame ColorView::on_depth(Frame frame) const {
  if (!rig_.color || frame.depth.size() != rays_.size() || frame.color.empty()) return frame;
  const Camera& c = rig_.color->camera;
  const std::vector<float> nearest = depth_of(project(frame.depth));
  std::vector<float> filled = frame.depth;
  std::replace(filled.begin(), filled.end(), 0.0f, kUnknownDepth);
  const std::vector<Projection> projections = project(filled);
  const auto side = static_cast<int>(std::clamp(std::lround(c.fx / rig_.depth.fx), 1L, 8L));
  std::vector<std::uint32_t> color(projections.size(), 0xff000000u);
  for (std::size_t i = 0; i < projections.size(); ++i) {
    const auto [u, v, z] = projections[i];
    if (z == 0 || !(u >= 0 && v >= 0 && u <= static_cast<float>(c.width - 1) && v <= static_cast<float>(c.height - 1)))
      continue;
    const float first = nearest[static_cast<std::size_t>(std::lround(v)) * static_cast<std::size_t>(c.width) +
                                static_cast<std::size_t>(std::lround(u))];
    if (frame.depth[i] > 0 && first > 0 && first < z - (kMinOcclusion + 4 * rig_.sensor.sigma(z))) continue;
    color[i] = mean_around(frame.color, c, u, v, side);
  }
  frame.color = std::move(color);
  return frame;
}

}  // namespace cairn
