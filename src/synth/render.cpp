// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/render.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "spirv/scene_render.comp.h"

namespace cairn {
namespace {

/// Of a ball around the centre that holds the solid, in metres, with room for rounding.
float reach(const Scene::Solid& s) {
  return s.shape == Scene::Shape::hollow ? 1e9f : 1.01f * s.half_size.norm() + 0.01f;
}

shader::Solid to_shader(const Scene::Solid& s) {
  return {.centre = s.centre,
          .half_size = s.half_size,
          .heading = {std::cos(s.yaw), std::sin(s.yaw)},
          .reach = reach(s),
          .shape = static_cast<std::uint32_t>(s.shape),
          .pattern = static_cast<std::uint32_t>(s.pattern),
          .scale = s.scale,
          .colour = s.colour,
          .second = s.second};
}

}  // namespace

SceneRenderer::SceneRenderer(gpu::Device& device, const Scene& scene, const Camera& camera)
    : device_(device),
      scene_(scene),
      camera_(camera),
      solid_count_(static_cast<std::uint32_t>(scene.solids.size())),
      solids_(device, scene.solids.size() * sizeof(shader::Solid)),
      depth_(device, std::uint64_t{4} * static_cast<std::uint64_t>(camera.width * camera.height)),
      cosine_(device, depth_.size()),
      colour_(device, depth_.size()),
      rays_(device, camera.distorted() ? 2 * depth_.size() : 8),
      render_(device, "scene_render", scene_render_comp) {
  upload(0);
  if (!camera.distorted()) return;
  std::vector<shader::vec2> rays;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2f ray = camera.undistorted_ray(x, y).cast<float>();
      rays.push_back({ray.x(), ray.y()});
    }
  gpu::Batch batch(device_);
  batch.upload(rays_, rays);
  batch.run();
}

void SceneRenderer::upload(double seconds) {
  std::vector<shader::Solid> solids;
  for (const auto& s : scene_.solids_at(seconds)) solids.push_back(to_shader(s));
  gpu::Batch batch(device_);
  batch.upload(solids_, solids);
  batch.run();
}

SceneImages SceneRenderer::render(const Eigen::Isometry3d& world_from_camera, double seconds) {
  if (scene_.moves()) upload(seconds);
  const auto pixels = static_cast<std::size_t>(camera_.width * camera_.height);
  SceneImages images{std::vector<float>(pixels), std::vector<float>(pixels), std::vector<std::uint32_t>(pixels)};
  const shader::Pinhole camera = shader::pinhole(camera_);
  gpu::Batch batch(device_);
  render_(batch, {camera.width, camera.height, 1},
          {.camera = camera,
           .world_from_camera = shader::rigid(world_from_camera),
           .solids = solid_count_,
           .is_bent = camera_.distorted()},
          {&solids_, &depth_, &cosine_, &colour_, &rays_});
  batch.download(depth_, images.depth);
  batch.download(cosine_, images.cosine);
  batch.download(colour_, images.colour);
  batch.run();
  return images;
}

void add_kinect_noise(SceneImages& images, const Camera& camera, std::uint64_t seed, int frame) {
  constexpr float kBaseline = 0.075f;         // metres
  constexpr float kLateral = 0.5f;            // pixels, standard deviation
  constexpr float kDisparityNoise = 0.08f;    // pixels, standard deviation
  constexpr float kDisparityStep = 0.125f;    // pixels
  constexpr float kGrazing = 0.15f;           // cosine
  constexpr float kNear = 0.4f, kFar = 5.0f;  // metres
  constexpr float kColourNoise = 2.0f;        // grey levels
  std::mt19937_64 random(seed * 1000003u + static_cast<std::uint64_t>(frame));
  // Sums of uniform numbers: the same normal-like bits with every standard library, unlike std::normal_distribution.
  const auto normal = [&] {
    const std::uint64_t r = random();
    float sum = 0;
    for (int i = 0; i < 4; ++i) sum += static_cast<float>((r >> (16 * i)) & 0xffff);
    return (sum / 65535.0f - 2.0f) * 1.7320508f;
  };
  const float bf = kBaseline * static_cast<float>(camera.fx);
  std::vector<float> noisy(images.depth.size(), 0.0f);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const int sx =
          std::clamp(static_cast<int>(std::lround(static_cast<float>(x) + kLateral * normal())), 0, camera.width - 1);
      const int sy =
          std::clamp(static_cast<int>(std::lround(static_cast<float>(y) + kLateral * normal())), 0, camera.height - 1);
      const auto at = static_cast<std::size_t>(sy * camera.width + sx);
      const float z = images.depth[at], noise = kDisparityNoise * normal();
      if (z < kNear || z > kFar || images.cosine[at] < kGrazing) continue;
      const float disparity = std::round((bf / z + noise) / kDisparityStep) * kDisparityStep;
      noisy[static_cast<std::size_t>(y * camera.width + x)] = bf / disparity;
    }
  }
  images.depth = std::move(noisy);
  for (auto& pixel : images.colour) {
    const float grain = kColourNoise * normal();
    std::uint32_t out = 0xff000000u;
    for (int shift = 0; shift < 24; shift += 8)
      out |= static_cast<std::uint32_t>(std::clamp(static_cast<float>((pixel >> shift) & 0xff) + grain, 0.0f, 255.0f))
             << shift;
    pixel = out;
  }
}

struct SceneCamera::State {
  State(const Scene& scene, const Camera& camera, int index) : device(index), renderer(device, scene, camera) {}
  gpu::Device device;
  SceneRenderer renderer;
};

SceneCamera::SceneCamera(const Scene& scene, const Camera& camera, int device)
    : state_(std::make_unique<State>(scene, camera, device)) {}
SceneCamera::~SceneCamera() = default;

SceneImages SceneCamera::look(const Eigen::Isometry3d& world_from_camera, double seconds) {
  return state_->renderer.render(world_from_camera, seconds);
}

}  // namespace cairn
