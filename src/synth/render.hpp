// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/scene.hpp"
#include "gpu/kernel.hpp"
#include "shaders/scene.h"

namespace cairn {

/// Renders a scene's exact depth and colour on the device.
class SceneRenderer {
 public:
  SceneRenderer(gpu::Device& device, const Scene& scene, const Camera& camera);
  struct Images {
    std::vector<float> depth;           // metres along z; 0: nothing within 100 m
    std::vector<float> cosine;          // between the ray and the surface's normal
    std::vector<std::uint32_t> colour;  // bytes R, G, B, 255
  };
  [[nodiscard]] Images render(const Eigen::Isometry3d& world_from_camera, double seconds = 0);

 private:
  void upload(double seconds);

  gpu::Device& device_;
  Scene scene_;
  Camera camera_;
  std::uint32_t solid_count_;
  gpu::Buffer solids_, depth_, cosine_, colour_;
  gpu::Kernel<shader::SceneRenderPush> render_;
};

/// What a Kinect would have measured (Khoshelham & Elberink 2012; Handa et al. 2014, sec. IV): pixels shifted by
/// lateral noise, disparity with noise and quantised to 1/8 pixel, nothing at grazing angles or out of 0.4 to 5 m.
/// Repeats for the same seed and frame.
void add_kinect_noise(SceneRenderer::Images& images, const Camera& camera, std::uint64_t seed, int frame);

}  // namespace cairn
