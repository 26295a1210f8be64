// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/mapping/frame.hpp"
#include "place/features.hpp"
#include "preprocess/frame_pyramid.hpp"

namespace cairn {

/// Color (bytes R, G, B, 255; empty without color) and depth (meters) of the same camera.
struct FeatureImages {
  std::vector<std::uint32_t> color;
  std::vector<float> depth;
  Camera camera;
};
/// Images of a frame for extract_features.
[[nodiscard]] FeatureImages feature_images(const FramePyramid& live, const Rig& rig, gpu::Device& device);

/// Features of a frame in the depth camera's view. With a separate color camera, the color image is the one registered
/// to depth on the device.
[[nodiscard]] Features features_of(const FramePyramid& live, const Rig& rig, gpu::Device& device);

}  // namespace cairn
