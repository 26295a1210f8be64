// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/source.hpp"

#include <algorithm>
#include <numbers>
#include <string_view>
#include <utility>

#include "synth/render.hpp"

namespace cairn {
namespace {

constexpr double kMaxGap = 2.5;                        // seconds
constexpr double kGravity = 9.81;                      // m/s^2, along y
const Eigen::Vector3d kPathCenter(-0.1, -0.1, -0.35);  // meters; center of the room's own path

constexpr double kRate = 30;  // frames per second

/// Number of frames up to the end of the path.
int all_frames(const Scene& scene) { return static_cast<int>(scene.duration() * kRate) + 1; }

int frames_of(const Scene& scene, const std::optional<int>& requested) {
  constexpr int kDefaultFrames = 300;
  return scene.name == "building" ? std::min(requested.value_or(all_frames(scene)), all_frames(scene))
                                  : requested.value_or(kDefaultFrames);
}

/// Source name split into scene and noise.
struct Named {
  std::string scene, noise = "none";
  explicit Named(std::string_view name) {
    constexpr std::string_view kNoise = "noise=";
    const std::size_t query = std::min(name.find('?'), name.size());
    scene = name.substr(0, query);
    char before = '?';
    for (std::size_t begin = query + 1; begin <= name.size();) {
      const std::size_t end = std::min(name.find('&', begin), name.size());
      const std::string_view text = name.substr(begin, end - begin);
      if (text.starts_with(kNoise))
        noise = text.substr(kNoise.size());
      else
        scene.append(1, std::exchange(before, '&')).append(text);
      begin = end + 1;
    }
  }
};

class SyntheticSource final : public Source {
 public:
  explicit SyntheticSource(const SyntheticOptions& options)
      : options_(options),
        name_(options.scene),
        scene_(synthetic_scene(name_.scene)),
        path_(scene_, {}, 0),
        rig_(synthetic_camera()),
        device_(options.device),
        renderer_(device_, scene_, rig_.depth),
        next_(options.first),
        end_(frames_of(scene_, options.frames)) {
    check_noise(name_.noise);
  }
  const Rig& rig() const override { return rig_; }
  std::string layout() const override { return "synthetic scene"; }
  std::optional<int> size() const override {
    return std::max(0, (end_ - options_.first + options_.step - 1) / options_.step);
  }

  std::optional<Frame> next() override {
    if (next_ >= end_) return std::nullopt;
    const double time = next_ / kRate;
    const auto pose = path_.pose(time);
    if (!pose) return std::nullopt;
    auto images = renderer_.render(*pose, time);
    add_noise(images, rig_.depth, name_.noise, kSeed, next_);
    Frame frame{.index = next_, .timestamp = time, .depth = std::move(images.depth), .color = std::move(images.color)};
    frame.acceleration = path_.acceleration(time);
    next_ += options_.step;
    return frame;
  }

 private:
  static constexpr std::uint64_t kSeed = 1;
  SyntheticOptions options_;
  Named name_;
  Scene scene_;
  SyntheticPath path_;
  Rig rig_;
  gpu::Device device_;
  SceneRenderer renderer_;
  int next_, end_;
};

}  // namespace

std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options) {
  return std::make_unique<SyntheticSource>(options);
}

Trajectory synthetic_truth(const std::string& name) {
  const Scene scene = synthetic_scene(Named(name).scene);
  Trajectory truth;
  for (int i = 0; i < all_frames(scene); ++i) truth.push_back({i / kRate, scene.world_from_camera(i / kRate)});
  return truth;
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
  scene_from_world.pretranslate(kPathCenter - bounds().center());
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
  return acceleration(seconds, kStep);
}

Eigen::Vector3d SyntheticPath::specific_force(double seconds) const {
  constexpr double kExactStep = 0.001, kRecordedStep = 0.02;  // seconds; a recorded path has corners
  return acceleration(seconds, recorded_.empty() ? kExactStep : kRecordedStep);
}

Eigen::Vector3d SyntheticPath::acceleration(double seconds, double step) const {
  const auto now = pose(seconds), before = pose(seconds - step), after = pose(seconds + step);
  Eigen::Vector3d acceleration(0, -kGravity, 0);
  if (now && before && after)
    acceleration += (before->translation() - 2 * now->translation() + after->translation()) / (step * step);
  return now ? now->linear().transpose() * acceleration : acceleration;
}

}  // namespace cairn
