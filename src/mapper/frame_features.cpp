// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/frame_features.hpp"

#include <bit>

#include "gpu/batch.hpp"
#include "shaders/types.h"

namespace cairn {

Features features_of(const FramePyramid& live, const Rig& rig, gpu::Device& device) {
  if (!rig.color) {
    const Frame& frame = live.images();
    return extract_features(frame.color, frame.depth, rig.depth);
  }
  const Camera camera = rig.depth.rectified();
  std::vector<shader::uvec2> pixels(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  live.register_color_to_depth();
  gpu::Batch batch(device);
  batch.download(*live.fusion, pixels);
  batch.run();
  std::vector<float> depth;
  std::vector<std::uint32_t> color;
  for (const auto& [bits, rgb] : pixels) {
    depth.push_back(std::bit_cast<float>(bits));
    if (live.has_color) color.push_back(rgb);
  }
  return extract_features(color, depth, camera);
}

}  // namespace cairn
