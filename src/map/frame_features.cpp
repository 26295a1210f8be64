// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/frame_features.hpp"

#include <bit>

#include "gpu/batch.hpp"
#include "shaders/types.h"

namespace cairn {

Features features_of(const Surface& live, const Rig& rig, gpu::Device& device) {
  if (!rig.colour) {
    const Frame& frame = live.images();
    return extract_features(frame.colour, frame.depth, rig.depth);
  }
  const Camera camera = rig.depth.rectified();
  std::vector<shader::uvec2> pixels(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  live.bring_colour();
  gpu::Batch batch(device);
  batch.download(*live.fusion, pixels);
  batch.run();
  std::vector<float> depth;
  std::vector<std::uint32_t> colour;
  for (const auto& [bits, rgb] : pixels) {
    depth.push_back(std::bit_cast<float>(bits));
    if (live.has_colour) colour.push_back(rgb);
  }
  return extract_features(colour, depth, camera);
}

}  // namespace cairn
