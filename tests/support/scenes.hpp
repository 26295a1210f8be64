// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "cairn/mapping/frame.hpp"
#include "cairn/synthetic/scene.hpp"
#include "preprocess/frame_pyramid.hpp"
#include "support/device.hpp"
#include "synth/render.hpp"

namespace cairn {

/// A quarter of the synthetic camera's pixels, to keep tests fast.
inline Camera small_camera() { return {320, 240, 262.5, 262.5, 159.5, 119.5, {}}; }

/// Frame `index` of a scene seen from a pose.
inline Frame scene_frame_at(const Scene& scene, const Camera& camera, const Eigen::Isometry3d& pose, int index = 0,
                            bool kinect_noise = false) {
  SceneRenderer renderer(test_device(), scene, camera);
  auto images = renderer.render(pose);
  if (kinect_noise) add_noise(images, camera, "kinect", 1, index);
  return {.index = index,
          .timestamp = index / 30.0,
          .depth = std::move(images.depth),
          .color = std::move(images.color),
          .world_from_camera = pose};
}

/// Frame `index` of a scene along its own path, 30 per second.
inline Frame scene_frame(const Scene& scene, const Camera& camera, int index, bool kinect_noise = false) {
  return scene_frame_at(scene, camera, scene.world_from_camera(index / 30.0), index, kinect_noise);
}

/// Source of given frames.
class GivenFrames final : public Source {
 public:
  GivenFrames(const Rig& rig, std::vector<Frame> frames) : rig_(rig), frames_(std::move(frames)) {}
  [[nodiscard]] const Rig& rig() const override { return rig_; }
  [[nodiscard]] std::optional<int> size() const override { return static_cast<int>(frames_.size() - next_); }
  [[nodiscard]] std::optional<Frame> next() override {
    return next_ < frames_.size() ? std::optional(frames_[next_++]) : std::nullopt;
  }

 private:
  Rig rig_;
  std::vector<Frame> frames_;
  std::size_t next_ = 0;
};

/// Path of the scene at a third of its speed, with hand-like swings of up to a radian per second.
inline PoseAt swung_in(const Scene& scene) {
  return [scene](double t) {
    Eigen::Isometry3d pose = scene.world_from_camera(0.3 * t);
    pose.rotate(Eigen::AngleAxisd(0.25 * std::sin(4.0 * t), Eigen::Vector3d::UnitX()));
    pose.rotate(Eigen::AngleAxisd(0.25 * std::sin(2.9 * t), Eigen::Vector3d::UnitY()));
    return pose;
  };
}

/// Surface of a frame, for code without device data; the frame must outlive the surface.
inline FramePyramid surface_of(const Frame& frame) {
  FramePyramid surface;
  surface.images = [&frame]() -> const Frame& { return frame; };
  return surface;
}

template <class T>
std::vector<T> download(const gpu::Buffer& buffer, std::size_t count) {
  std::vector<T> data(count);
  gpu::Batch batch(test_device());
  batch.download(buffer, data);
  batch.run();
  return data;
}

}  // namespace cairn
