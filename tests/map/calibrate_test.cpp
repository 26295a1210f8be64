// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// No calibration is better than a wrong one.
#include "cairn/calibrate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "support/scenes.hpp"

namespace cairn {
namespace {

using Change = std::function<void(Frame&)>;

Camera focused(Camera camera, double times) {
  camera.fx *= times, camera.fy *= times;
  return camera;
}

/// A scene with a Kinect's noise, seen from a camera that moves as `pose` says, each image changed as `change` says. A
/// readout that the camera has is not told.
class Recording final : public Source {
 public:
  Recording(const char* scene, Camera camera, int frames, PoseAt pose, Change change)
      : rig_(camera),
        scene_(synthetic_scene(scene)),
        frames_(frames),
        pose_(std::move(pose)),
        change_(std::move(change)),
        renderer_(std::in_place, test_device(), scene_, camera) {
    rig_.depth.readout = 0;
  }
  void refocus_at(int frame) { refocuses_at_ = frame; }
  /// Another camera than it is.
  void tell(const Camera& camera) { rig_.depth = camera; }
  [[nodiscard]] const Rig& rig() const override { return rig_; }
  [[nodiscard]] std::optional<int> size() const override { return frames_ - next_; }
  [[nodiscard]] std::optional<Frame> next() override {
    if (next_ == frames_) return std::nullopt;
    if (next_ == refocuses_at_) renderer_.emplace(test_device(), scene_, focused(rig_.depth, 1.03));
    const double time = next_ / 30.0;
    auto images = renderer_->render(pose_, time);
    add_noise(images, rig_.depth, "kinect", 1, next_);
    Frame frame{.index = next_++, .timestamp = time, .depth = images.depth, .colour = images.colour};
    if (change_) change_(frame);
    return frame;
  }

 private:
  Rig rig_;
  Scene scene_;
  int frames_, next_ = 0, refocuses_at_ = -1;
  PoseAt pose_;
  Change change_;
  std::optional<SceneRenderer> renderer_;
};

PoseAt path_of(const char* name) {
  return [scene = synthetic_scene(name)](double t) { return scene.world_from_camera(t); };
}

std::function<std::unique_ptr<Source>()> opener(const char* scene, int frames, const PoseAt& pose,
                                                const Change& change = {}, double readout = 0) {
  Camera camera = synthetic_camera();
  camera.readout = readout;
  return [=] { return std::make_unique<Recording>(scene, camera, frames, pose, change); };
}

/// Neither a readout nor a correction of depth is found, and the rig is as it was told.
void expect_nothing_found(const std::function<std::unique_ptr<Source>()>& open) {
  const FoundShutter shutter = find_shutter(open);
  std::printf("shutter: %d keyframes, %s\n", shutter.keyframes, shutter.why_not.c_str());
  EXPECT_NE(shutter.why_not, "");
  EXPECT_EQ(shutter.readout, 0);
  EXPECT_EQ(shutter.rig.depth.readout, 0);
  const FoundDepthCorrection depth = find_depth_correction(open);
  std::printf("depth: %d keyframes, %.4f better, %s\n", depth.keyframes, depth.predicts_better, depth.why_not.c_str());
  EXPECT_NE(depth.why_not, "");
  EXPECT_TRUE(depth.rig.depth_correction.empty());
  const FoundCalibration all = find_calibration(open);
  std::printf("all: %d keyframes, %.4f better, %s\n", all.keyframes, all.predicts_better, all.why_not.c_str());
  EXPECT_NE(all.why_not, "");
  EXPECT_EQ(all.rig, open()->rig());
}

TEST(Calibrate, FindsTheShutterOfACameraThatSwings) {
  constexpr double kReadout = 0.028;
  const FoundShutter found = find_shutter(opener("room", 90, swung_in(synthetic_scene("room")), {}, kReadout));
  std::printf("%.2f +- %.2f ms, %s\n", 1000 * found.readout, 1000 * found.sigma, found.why_not.c_str());
  EXPECT_EQ(found.why_not, "");
  EXPECT_NEAR(found.readout, kReadout, 0.002);
}

TEST(Calibrate, FindsCamerasThatNobodyTold) {
  Camera camera = focused(synthetic_camera(), 1.01);
  camera.cx += 3, camera.cy -= 2, camera.distortion[0] = 0.05, camera.readout = 0.028;
  const FoundCalibration found = find_calibration([=] {
    auto recording = std::make_unique<Recording>("room", camera, 120, swung_in(synthetic_scene("room")), Change{});
    recording->tell(synthetic_camera());
    return recording;
  });
  const Camera& c = found.rig.depth;
  std::printf("f %.2f %.2f c %.2f %.2f k1 %.4f readout %.2f ms, clock %.2f ms, %.3f better, %d keyframes %s\n", c.fx,
              c.fy, c.cx, c.cy, c.distortion[0], 1000 * c.readout, 1000 * found.clock_offset, found.predicts_better,
              found.keyframes, found.why_not.c_str());
  ASSERT_EQ(found.why_not, "");
  EXPECT_NEAR(c.fx, camera.fx, 0.001 * camera.fx);
  EXPECT_NEAR(c.fy, camera.fy, 0.001 * camera.fy);
  EXPECT_NEAR(c.distortion[0], camera.distortion[0], 0.005);
  EXPECT_NEAR(c.readout, camera.readout, 0.002);
}

TEST(Calibrate, FindsNothingFromAStaticCamera) {
  expect_nothing_found(opener("room", 15, [](double) { return synthetic_scene("room").world_from_camera(0); }));
}

TEST(Calibrate, FindsNothingFromAWall) {
  expect_nothing_found(opener("plane", 90, swung_in(synthetic_scene("plane"))));
}

TEST(Calibrate, FindsNothingFromTwentyFrames) { expect_nothing_found(opener("room", 20, path_of("room"))); }

TEST(Calibrate, FindsNothingFromViewsThatDoNotOverlap) {
  const auto turn = [](double t) {
    Eigen::Isometry3d pose = synthetic_scene("room").world_from_camera(0);
    pose.rotate(Eigen::AngleAxisd(2.1 * std::round(30 * t), Eigen::Vector3d::UnitY()));
    return pose;
  };
  expect_nothing_found(opener("room", 30, turn));
}

TEST(Calibrate, FindsNothingFromACameraThatIsRefocused) {
  static constexpr int kFrames = 90;
  expect_nothing_found([] {
    auto recording =
        std::make_unique<Recording>("room", synthetic_camera(), kFrames, swung_in(synthetic_scene("room")), Change{});
    recording->refocus_at(kFrames / 2);
    return recording;
  });
}

TEST(Calibrate, FindsNothingWhereExposureJumps) {
  const auto darker = [](Frame& frame) {
    if (frame.index / 10 % 2 == 0) return;
    for (std::uint32_t& rgba : frame.colour)
      rgba =
          0xff000000u | (rgba & 0xff) * 5 / 8 | ((rgba >> 8 & 0xff) * 5 / 8) << 8 | ((rgba >> 16 & 0xff) * 5 / 8) << 16;
  };
  expect_nothing_found(opener("room", 90, swung_in(synthetic_scene("room")), darker));
}

}  // namespace
}  // namespace cairn
