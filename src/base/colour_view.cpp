// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/colour_view.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn {

ColourView::ColourView(const Rig& rig) : rig_(rig) {
  if (!rig.colour) return;
  for (int y = 0; y < rig.depth.height; ++y)
    for (int x = 0; x < rig.depth.width; ++x) rays_.emplace_back(rig.depth.undistorted_ray(x, y).cast<float>());
}

Frame ColourView::operator()(Frame frame) const {
  if (!rig_.colour || frame.depth.size() != rays_.size()) return frame;
  const Camera& c = rig_.colour->camera;
  const Eigen::Isometry3f colour_from_depth = rig_.colour->colour_from_depth.cast<float>();
  const double widest = c.widest_ray();
  // A depth pixel's surface covers so many colour pixels to each side of its middle.
  const auto reach = static_cast<float>(0.5 * std::max(c.fx / rig_.depth.fx, 1.0));
  std::vector<float> depth(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height), 0.0f);
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    if (frame.depth[i] <= 0) continue;
    const Eigen::Vector3f p = colour_from_depth * (frame.depth[i] * rays_[i].homogeneous());
    const Eigen::Vector2d ray = p.head<2>().cast<double>() / static_cast<double>(p.z());
    if (p.z() <= 0 || ray.norm() > widest) continue;
    const Eigen::Vector2d bent = c.distort(ray);
    const auto u = static_cast<float>(c.fx * bent.x() + c.cx), v = static_cast<float>(c.fy * bent.y() + c.cy);
    if (!(u > -reach && v > -reach && u < static_cast<float>(c.width) + reach &&
          v < static_cast<float>(c.height) + reach))
      continue;
    const auto first = [&](float at) { return std::max(static_cast<int>(std::ceil(at - reach)), 0); };
    const int last_x = std::min(static_cast<int>(std::floor(u + reach)), c.width - 1),
              last_y = std::min(static_cast<int>(std::floor(v + reach)), c.height - 1);
    for (int y = first(v); y <= last_y; ++y)
      for (int x = first(u); x <= last_x; ++x) {
        float& nearest =
            depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x)];
        if (nearest == 0 || p.z() < nearest) nearest = p.z();
      }
  }
  frame.depth = std::move(depth);
  return frame;
}

}  // namespace cairn
