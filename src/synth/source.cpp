// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/source.hpp"

#include "synth/render.hpp"

namespace cairn {
namespace {

class SyntheticSource final : public Source {
 public:
  explicit SyntheticSource(const SyntheticOptions& options)
      : options_(options),
        scene_(synthetic_scene(options.scene)),
        camera_(synthetic_camera()),
        device_(options.device),
        render_(device_, scene_, camera_) {}
  const Camera& camera() const override { return camera_; }
  std::optional<int> size() const override { return options_.frames; }

  std::optional<Frame> next() override {
    if (next_ >= options_.frames) return std::nullopt;
    const double time = next_ / 30.0;
    const auto pose = synthetic_pose(scene_, options_.path, time);
    if (!pose) return std::nullopt;
    auto images = render_(*pose, time);
    if (options_.kinect_noise) add_kinect_noise(images, camera_, options_.seed, next_);
    Frame frame{
        .index = next_++, .timestamp = time, .depth = std::move(images.depth), .colour = std::move(images.colour)};
    if (options_.with_poses) frame.world_from_camera = *pose;
    return frame;
  }

 private:
  SyntheticOptions options_;
  Scene scene_;
  Camera camera_;
  gpu::Device device_;
  SceneRenderer render_;
  int next_ = 0;
};

}  // namespace

std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options) {
  return std::make_unique<SyntheticSource>(options);
}

std::optional<Eigen::Isometry3d> synthetic_pose(const Scene& scene, const Trajectory& path, double seconds) {
  if (path.empty()) return scene.world_from_camera(seconds);
  const auto pose = pose_at(path, path.front().timestamp + seconds, 0.5);
  if (!pose) return std::nullopt;
  // The path starts where the scene's own does.
  return scene.world_from_camera(0) * path.front().world_from_camera.inverse() * *pose;
}

}  // namespace cairn
