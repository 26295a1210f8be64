// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// No calibration is better than a wrong one.
#include "cairn/mapping/calibrate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "support/scenes.hpp"

namespace cairn {
namespace {

using Change = std::function<void(Frame&)>;

Camera focused(Camera camera, double times) {
  camera.fx *= times, camera.fy *= times;
  return camera;
}

/// Scene with a Kinect's noise, seen from a camera along `pose`, with `change` applied to each image.
struct Rendering {
  const char* scene = "room";
  Camera camera = synthetic_camera();
  int frames = 0;
  PoseAt pose;
  Change change = {};
  int refocuses_at = -1;  // frame
};

/// Rendered once and shared by all callers.
std::shared_ptr<const std::vector<Frame>> frames_of(const Rendering& r) {
  const Scene scene = synthetic_scene(r.scene);
  std::optional<SceneRenderer> renderer(std::in_place, test_device(), scene, r.camera);
  auto frames = std::make_shared<std::vector<Frame>>();
  for (int i = 0; i < r.frames; ++i) {
    if (i == r.refocuses_at) renderer.emplace(test_device(), scene, focused(r.camera, 1.03));
    const double time = i / 30.0;
    auto images = renderer->render(r.pose, time);
    add_noise(images, r.camera, "kinect", 1, i);
    Frame frame{.index = i, .timestamp = time, .depth = std::move(images.depth), .color = std::move(images.color)};
    if (r.change) r.change(frame);
    frames->push_back(std::move(frame));
  }
  return frames;
}

class Recording final : public Source {
 public:
  Recording(std::shared_ptr<const std::vector<Frame>> frames, const Rig& given)
      : rig_(given), frames_(std::move(frames)) {}
  [[nodiscard]] const Rig& rig() const override { return rig_; }
  [[nodiscard]] std::optional<int> size() const override { return static_cast<int>(frames_->size() - next_); }
  [[nodiscard]] std::optional<Frame> next() override {
    if (next_ == frames_->size()) return std::nullopt;
    return (*frames_)[next_++];
  }

 private:
  Rig rig_;
  std::shared_ptr<const std::vector<Frame>> frames_;
  std::size_t next_ = 0;
};

using Open = std::function<std::unique_ptr<Source>()>;

/// Recording with the default camera, without a readout.
Open opener(const Rendering& rendering) {
  return [frames = frames_of(rendering)] { return std::make_unique<Recording>(frames, synthetic_camera()); };
}

PoseAt path_of(const char* name) {
  return [scene = synthetic_scene(name)](double t) { return scene.world_from_camera(t); };
}

/// Expects neither a readout nor a depth correction, and an unchanged rig.
void expect_nothing_found(const Open& open) {
  const FoundShutter shutter = find_shutter(open);
  std::printf("shutter: %d keyframes, %s\n", shutter.keyframes, shutter.failure_reason.c_str());
  EXPECT_NE(shutter.failure_reason, "");
  EXPECT_EQ(shutter.readout, 0);
  EXPECT_EQ(shutter.rig.depth.readout, 0);
  const FoundDepthCorrection depth = find_depth_correction(open);
  std::printf("depth: %d keyframes, %.4f better, %s\n", depth.keyframes, depth.error_reduction,
              depth.failure_reason.c_str());
  EXPECT_NE(depth.failure_reason, "");
  EXPECT_TRUE(depth.rig.depth_correction.empty());
  const FoundCalibration all = find_calibration(open);
  std::printf("all: %d keyframes, %.4f better, %s\n", all.keyframes, all.error_reduction, all.failure_reason.c_str());
  EXPECT_NE(all.failure_reason, "");
  EXPECT_EQ(all.rig, open()->rig());
}

PoseAt swinging(const char* scene = "room") { return swung_in(synthetic_scene(scene)); }

TEST(Calibrate, EstimatesTheReadoutOfASwingingCamera) {
  constexpr double kReadout = 0.028;
  Camera camera = synthetic_camera();
  camera.readout = kReadout;
  const FoundShutter found = find_shutter(opener({.camera = camera, .frames = 90, .pose = swinging()}));
  std::printf("%.2f +- %.2f ms, %s\n", 1000 * found.readout, 1000 * found.sigma, found.failure_reason.c_str());
  EXPECT_EQ(found.failure_reason, "");
  EXPECT_NEAR(found.readout, kReadout, 0.002);
}

TEST(Calibrate, EstimatesUnknownCameras) {
  Camera camera = focused(synthetic_camera(), 1.01);
  camera.cx += 3, camera.cy -= 2, camera.distortion[0] = 0.05, camera.readout = 0.028;
  const FoundCalibration found = find_calibration(opener({.camera = camera, .frames = 120, .pose = swinging()}));
  const Camera& c = found.rig.depth;
  std::printf("f %.2f %.2f c %.2f %.2f k1 %.4f readout %.2f ms, clock %.2f ms, %.3f better, %d keyframes %s\n", c.fx,
              c.fy, c.cx, c.cy, c.distortion[0], 1000 * c.readout, 1000 * found.clock_offset, found.error_reduction,
              found.keyframes, found.failure_reason.c_str());
  ASSERT_EQ(found.failure_reason, "");
  EXPECT_NEAR(c.fx, camera.fx, 0.001 * camera.fx);
  EXPECT_NEAR(c.fy, camera.fy, 0.001 * camera.fy);
  EXPECT_NEAR(c.distortion[0], camera.distortion[0], 0.005);
  EXPECT_NEAR(c.readout, camera.readout, 0.002);
}

TEST(Calibrate, FindsNothingFromAStaticCamera) {
  expect_nothing_found(
      opener({.frames = 15, .pose = [](double) { return synthetic_scene("room").world_from_camera(0); }}));
}

TEST(Calibrate, FindsNothingFromAWall) {
  expect_nothing_found(opener({.scene = "plane", .frames = 90, .pose = swinging("plane")}));
}

TEST(Calibrate, FindsNothingFromTwentyFrames) { expect_nothing_found(opener({.frames = 20, .pose = path_of("room")})); }

TEST(Calibrate, FindsNothingFromViewsThatDoNotOverlap) {
  const auto turn = [](double t) {
    Eigen::Isometry3d pose = synthetic_scene("room").world_from_camera(0);
    pose.rotate(Eigen::AngleAxisd(2.1 * std::round(30 * t), Eigen::Vector3d::UnitY()));
    return pose;
  };
  expect_nothing_found(opener({.frames = 30, .pose = turn}));
}

TEST(Calibrate, RejectsARefocusedCamera) {
  expect_nothing_found(opener({.frames = 90, .pose = swinging(), .refocuses_at = 45}));
}

TEST(Calibrate, FindsNothingWithExposureJumps) {
  const auto darker = [](Frame& frame) {
    if (frame.index / 10 % 2 == 0) return;
    for (std::uint32_t& rgba : frame.color)
      rgba =
          0xff000000u | (rgba & 0xff) * 5 / 8 | ((rgba >> 8 & 0xff) * 5 / 8) << 8 | ((rgba >> 16 & 0xff) * 5 / 8) << 16;
  };
  expect_nothing_found(opener({.frames = 90, .pose = swinging(), .change = darker}));
}

}  // namespace
}  // namespace cairn
