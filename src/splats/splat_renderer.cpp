// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/splat_renderer.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {

RenderedView SplatRenderer::operator()(const Camera& camera, const Eigen::Isometry3d& world_from_camera) {
  constexpr float kMinOpacity = 0.5f;  // of a surface
  rasterizer_.forward(model_, {.camera = camera, .world_from_camera = world_from_camera});
  const SplatImage image = rasterizer_.download_image();
  RenderedView view;
  for (std::size_t i = 0; i < image.color.size(); ++i) {
    view.depth.push_back(image.opacity[i] > kMinOpacity ? image.depth[i] / image.opacity[i] : 0.0f);
    std::uint32_t word = 0xff000000u;
    for (int c = 0; c < 3; ++c)
      word |= static_cast<std::uint32_t>(std::lround(std::clamp(255 * image.color[i][c], 0.0f, 255.0f))) << (8 * c);
    view.color.push_back(word);
  }
  return view;
}

}  // namespace cairn
