// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "cairn/mapping/frame.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "gpu/kernel.hpp"
#include "shaders/scene.h"

namespace cairn {

/// Renders a scene's exact depth and color on the device.
class SceneRenderer {
 public:
  SceneRenderer(gpu::Device& device, const Scene& scene, const Camera& camera);
  [[nodiscard]] SceneImages render(const PoseAt& world_from_camera, double seconds);
  [[nodiscard]] SceneImages render(const Eigen::Isometry3d& world_from_camera, double seconds = 0) {
    return render([&](double) { return world_from_camera; }, seconds);
  }

 private:
  std::uint32_t upload(gpu::Batch& batch, const Eigen::Isometry3d& world_from_camera, double seconds);

  gpu::Device& device_;
  Scene scene_;
  Camera camera_;
  gpu::Buffer solids_, depth_, cosine_, color_;
  gpu::Buffer rays_;  // of a camera with distortion
  gpu::Buffer rows_;  // world_from_camera by row of a rolling shutter
  gpu::Kernel<shader::SceneRenderPush> render_;
};

}  // namespace cairn
