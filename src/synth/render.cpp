// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/render.hpp"

#include <algorithm>
#include <cmath>

#include "spirv/scene_render.comp.h"

namespace cairn {
namespace {

/// Radius of a ball around the center that contains the solid, in meters, with a margin for rounding.
float reach(const Scene::Solid& s) {
  return s.shape == Scene::Shape::hollow ? 1e9f : 1.01f * s.half_size.norm() + 0.01f;
}

shader::Solid to_shader(const Scene::Solid& s) {
  return {.center = s.center,
          .half_size = s.half_size,
          .heading = {std::cos(s.yaw), std::sin(s.yaw)},
          .reach = reach(s),
          .shape = static_cast<std::uint32_t>(s.shape),
          .pattern = static_cast<std::uint32_t>(s.pattern),
          .scale = s.scale,
          .color = s.color,
          .second = s.second};
}

/// Conservative view of a camera: a cone around the directions of its pixels, up to the maximum depth.
class View {
 public:
  View(const Camera& camera, const Eigen::Isometry3d& world_from_camera)
      : from_(world_from_camera.translation()), axis_(world_from_camera.linear().col(2)) {
    constexpr double kLensMargin = 0.1;  // radians of a lens beyond its corners, at most
    for (const double x : {0.0, camera.width - 1.0})
      for (const double y : {0.0, camera.height - 1.0}) {
        const Eigen::Vector2d corner = camera.distorted() ? camera.undistorted_ray(x, y) : camera.ray(x, y).head<2>();
        angle_ = std::max(angle_, std::atan(corner.norm()));
      }
    angle_ += camera.distorted() ? kLensMargin : 1e-3;
  }
  [[nodiscard]] bool reaches(const Scene::Solid& s) const {
    const Eigen::Vector3d to = s.center.cast<double>() - from_;
    const double distance = to.norm(), size = reach(s);
    if (distance <= size) return true;
    if (distance > kMaxDistance + size) return false;
    return std::acos(std::clamp(to.dot(axis_) / distance, -1.0, 1.0)) <= angle_ + std::asin(size / distance);
  }

 private:
  static constexpr double kMaxDistance = 180;  // meters: 100 along the axis, at 55 degrees beside it
  Eigen::Vector3d from_, axis_;
  double angle_ = 0;
};

}  // namespace

SceneRenderer::SceneRenderer(gpu::Device& device, const Scene& scene, const Camera& camera)
    : device_(device),
      scene_(scene),
      camera_(camera),
      solids_(device, scene.solids.size() * sizeof(shader::Solid)),
      depth_(device, std::uint64_t{4} * static_cast<std::uint64_t>(camera.width * camera.height)),
      cosine_(device, depth_.size()),
      color_(device, depth_.size()),
      rays_(device, camera.distorted() ? 2 * depth_.size() : 8),
      rows_(device, camera.readout > 0 ? static_cast<std::uint64_t>(camera.height) * sizeof(shader::Rigid)
                                       : sizeof(shader::Rigid)),
      render_(device, "scene_render", scene_render_comp) {
  if (!camera.distorted()) return;
  std::vector<shader::vec2> rays;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2f ray = camera.undistorted_ray(x, y).cast<float>();
      rays.push_back({ray.x(), ray.y()});
    }
  gpu::Batch batch(device_);
  batch.upload(rays_, rays);
  batch.submit();
}

/// Uploads the solids possibly in view at a given time; most of a building is out of view. With a rolling shutter,
/// uploads all, since each row has its own pose.
std::uint32_t SceneRenderer::upload(gpu::Batch& batch, const Eigen::Isometry3d& world_from_camera, double seconds) {
  const View view(camera_, world_from_camera);
  std::vector<shader::Solid> solids;
  for (const auto& s : scene_.solids_at(seconds))
    if (camera_.readout > 0 || view.reaches(s)) solids.push_back(to_shader(s));
  if (!solids.empty()) batch.upload(solids_, solids);
  return static_cast<std::uint32_t>(solids.size());
}

SceneImages SceneRenderer::render(const PoseAt& world_from_camera, double seconds) {
  const auto pixels = static_cast<std::size_t>(camera_.width * camera_.height);
  SceneImages images{.depth = std::vector<float>(pixels),
                     .cosine = std::vector<float>(pixels),
                     .color = std::vector<std::uint32_t>(pixels),
                     .confidence = {}};
  const shader::Pinhole camera = shader::pinhole(camera_);
  gpu::Batch batch(device_);
  const std::uint32_t solids = upload(batch, world_from_camera(seconds), seconds);
  if (camera_.readout > 0) {
    std::vector<shader::Rigid> rows;
    rows.reserve(static_cast<std::size_t>(camera_.height));
    for (int y = 0; y < camera_.height; ++y)
      rows.push_back(shader::rigid(world_from_camera(seconds + camera_.row_delay(y))));
    batch.upload(rows_, rows);
  }
  render_(batch, {camera.width, camera.height, 1},
          {.camera = camera,
           .world_from_camera = shader::rigid(world_from_camera(seconds)),
           .solids = solids,
           .is_bent = camera_.distorted(),
           .is_rolling = camera_.readout > 0},
          {&solids_, &depth_, &cosine_, &color_, &rays_, &rows_});
  batch.download(depth_, images.depth);
  batch.download(cosine_, images.cosine);
  batch.download(color_, images.color);
  batch.run();
  return images;
}

struct SceneCamera::State {
  State(const Scene& scene, const Camera& camera, int index) : device(index), renderer(device, scene, camera) {}
  gpu::Device device;
  SceneRenderer renderer;
};

SceneCamera::SceneCamera(const Scene& scene, const Camera& camera, int device)
    : state_(std::make_unique<State>(scene, camera, device)) {}
SceneCamera::~SceneCamera() = default;

SceneImages SceneCamera::render(const Eigen::Isometry3d& world_from_camera, double seconds) {
  return state_->renderer.render(world_from_camera, seconds);
}

SceneImages SceneCamera::render(const PoseAt& world_from_camera, double seconds) {
  return state_->renderer.render(world_from_camera, seconds);
}

}  // namespace cairn
