// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/frame_features.hpp"

#include <bit>

#include "gpu/batch.hpp"
#include "shaders/types.h"

namespace cairn {

FeatureImages feature_images(const FramePyramid& live, const Rig& rig, gpu::Device& device) {
  if (!rig.color) return {live.images().color, live.images().depth, rig.depth};
  FeatureImages images{{}, {}, rig.depth.rectified()};
  const Camera& camera = images.camera;
  std::vector<shader::uvec2> pixels(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  live.register_color_to_depth();
  gpu::Batch batch(device);
  batch.download(*live.fusion, pixels);
  batch.run();
  images.depth.reserve(pixels.size());
  if (live.has_color) images.color.reserve(pixels.size());
  for (const auto& [bits, rgb] : pixels) {
    images.depth.push_back(std::bit_cast<float>(bits));
    if (live.has_color) images.color.push_back(rgb);
  }
  return images;
}

Features features_of(const FramePyramid& live, const Rig& rig, gpu::Device& device) {
  const FeatureImages images = feature_images(live, rig, device);
  return extract_features(images.color, images.depth, images.camera);
}

}  // namespace cairn
