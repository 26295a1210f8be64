// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/synthetic.hpp"
#include "gpu/kernel.hpp"
#include "shaders/scene.h"

namespace cairn {

/// Renders a scene's exact depth and colour on the device.
class SceneRenderer {
 public:
  SceneRenderer(gpu::Device& device, const Scene& scene, const Camera& camera);
  [[nodiscard]] SceneImages render(const Eigen::Isometry3d& world_from_camera, double seconds = 0);

 private:
  void upload(double seconds);

  gpu::Device& device_;
  Scene scene_;
  Camera camera_;
  std::uint32_t solid_count_;
  gpu::Buffer solids_, depth_, cosine_, colour_;
  gpu::Buffer rays_;  // of a camera with distortion
  gpu::Kernel<shader::SceneRenderPush> render_;
};

}  // namespace cairn
