// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/source.hpp"

#include <numbers>

#include "synth/render.hpp"

namespace cairn {
namespace {

constexpr double kMaxGap = 2.5;                    // seconds
constexpr double kGravity = 9.81;                  // m/s^2, along y
const Eigen::Vector3d kMiddle(-0.1, -0.1, -0.35);  // metres; where the room's own path goes around

class SyntheticSource final : public Source {
 public:
  explicit SyntheticSource(const SyntheticOptions& options)
      : options_(options),
        scene_(synthetic_scene(options.scene)),
        path_(scene_, {}, 0),
        rig_(synthetic_camera()),
        device_(options.device),
        renderer_(device_, scene_, rig_.depth),
        next_(options.first) {}
  const Rig& rig() const override { return rig_; }
  std::string layout() const override { return "synthetic scene"; }
  std::optional<int> size() const override {
    return (options_.frames - options_.first + options_.step - 1) / options_.step;
  }

  std::optional<Frame> next() override {
    if (next_ >= options_.frames) return std::nullopt;
    const double time = next_ / 30.0;
    const auto pose = path_.pose(time);
    if (!pose) return std::nullopt;
    auto images = renderer_.render(*pose, time);
    if (options_.kinect_noise) add_noise(images, rig_.depth, "kinect", options_.seed, next_);
    Frame frame{
        .index = next_, .timestamp = time, .depth = std::move(images.depth), .colour = std::move(images.colour)};
    frame.acceleration = path_.acceleration(time);
    next_ += options_.step;
    if (options_.with_poses) frame.world_from_camera = *pose;
    return frame;
  }

 private:
  SyntheticOptions options_;
  Scene scene_;
  SyntheticPath path_;
  Rig rig_;
  gpu::Device device_;
  SceneRenderer renderer_;
  int next_;
};

}  // namespace

std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options) {
  return std::make_unique<SyntheticSource>(options);
}

SyntheticPath::SyntheticPath(Scene scene, Trajectory recorded, double seconds)
    : scene_(std::move(scene)), recorded_(std::move(recorded)) {
  if (recorded_.empty()) return;
  Eigen::Isometry3d scene_from_world = Eigen::Isometry3d::Identity();
  scene_from_world.linear() = Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const auto bounds = [&] {
    Eigen::AlignedBox3d box;
    for (const auto& p : recorded_)
      if (p.timestamp <= recorded_.front().timestamp + seconds)
        box.extend(scene_from_world * p.world_from_camera.translation());
    return box;
  };
  if (const Eigen::Vector3d sizes = bounds().sizes(); sizes.z() > sizes.x())
    scene_from_world.prerotate(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitY()));
  scene_from_world.pretranslate(kMiddle - bounds().center());
  for (auto& p : recorded_) p.world_from_camera = scene_from_world * p.world_from_camera;
}

std::optional<Eigen::Isometry3d> SyntheticPath::pose(double seconds) const {
  if (recorded_.empty()) return scene_.world_from_camera(seconds);
  return pose_at(recorded_, recorded_.front().timestamp + seconds, kMaxGap);
}

Eigen::Vector3d SyntheticPath::angular_rate(double seconds) const {
  constexpr double kStep = 0.002;  // seconds
  const auto before = pose(std::max(seconds - kStep, 0.0)), after = pose(seconds + kStep);
  if (!before || !after) return Eigen::Vector3d::Zero();
  const Eigen::AngleAxisd turn(before->linear().transpose() * after->linear());
  return turn.angle() / (seconds + kStep - std::max(seconds - kStep, 0.0)) * turn.axis();
}

Eigen::Vector3d SyntheticPath::acceleration(double seconds) const {
  constexpr double kStep = 0.1;  // seconds; recorded positions jitter
  const auto now = pose(seconds), before = pose(seconds - kStep), after = pose(seconds + kStep);
  Eigen::Vector3d acceleration(0, -kGravity, 0);
  if (now && before && after)
    acceleration += (before->translation() - 2 * now->translation() + after->translation()) / (kStep * kStep);
  return now ? now->linear().transpose() * acceleration : acceleration;
}

}  // namespace cairn
