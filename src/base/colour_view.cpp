// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/colour_view.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn {
namespace {

constexpr float kJump = 0.05f;  // of the depth, between neighbours on two surfaces
constexpr float kMost = 16;     // colour pixels that a depth pixel may cover to each side

}  // namespace

ColourView::ColourView(const Rig& rig) : rig_(rig) {
  if (!rig.colour) return;
  for (int y = 0; y < rig.depth.height; ++y)
    for (int x = 0; x < rig.depth.width; ++x) rays_.emplace_back(rig.depth.undistorted_ray(x, y).cast<float>());
}

/// A depth pixel's point as the colour camera sees it.
struct ColourView::Seen {
  float u, v, z;  // pixels, metres; z = 0: not seen
};

std::vector<ColourView::Seen> ColourView::project(const std::vector<float>& depth) const {
  const Camera& c = rig_.colour->camera;
  const Eigen::Isometry3f colour_from_depth = rig_.colour->colour_from_depth.cast<float>();
  const double widest = c.widest_ray();
  std::vector<Seen> all(depth.size(), Seen{0, 0, 0});
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (depth[i] <= 0) continue;
    const Eigen::Vector3f p = colour_from_depth * (depth[i] * rays_[i].homogeneous());
    if (p.z() <= 0) continue;
    const Eigen::Vector2d ray = p.head<2>().cast<double>() / static_cast<double>(p.z());
    if (ray.norm() > widest) continue;
    const Eigen::Vector2d bent = c.distort(ray);
    all[i] = {static_cast<float>(c.fx * bent.x() + c.cx), static_cast<float>(c.fy * bent.y() + c.cy), p.z()};
  }
  return all;
}

Frame ColourView::operator()(Frame frame) const {
  if (!rig_.colour || frame.depth.size() != rays_.size()) return frame;
  const Camera& c = rig_.colour->camera;
  const int width = rig_.depth.width, height = rig_.depth.height;
  const std::vector<Seen> all = project(frame.depth);
  const auto least =
      static_cast<float>(0.5 * std::max(c.fx / rig_.depth.fx, 1.0));  // pixels, of a surface seen from the front
  std::vector<float> depth(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height), 0.0f);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Seen& s = all[static_cast<std::size_t>(y * width + x)];
      if (s.z == 0) continue;
      // It reaches half the way to the neighbours that are the same surface.
      Eigen::Array4f reach = Eigen::Array4f::Constant(least);  // left, right, up, down
      for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        if (x + dx < 0 || x + dx >= width || y + dy < 0 || y + dy >= height) continue;
        const Seen& other = all[static_cast<std::size_t>((y + dy) * width + x + dx)];
        if (other.z == 0 || std::abs(other.z - s.z) > kJump * s.z) continue;
        const float u = 0.5f * (other.u - s.u), v = 0.5f * (other.v - s.v);
        reach = reach.max(Eigen::Array4f(-u, u, -v, v));
      }
      if (!(s.u > -kMost && s.v > -kMost && s.u < static_cast<float>(c.width) + kMost &&
            s.v < static_cast<float>(c.height) + kMost))
        continue;
      reach = reach.min(kMost);
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
  frame.depth = std::move(depth);
  return frame;
}

}  // namespace cairn
