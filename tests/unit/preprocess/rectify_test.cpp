// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "preprocess/rectify.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "geometry/readout.hpp"
#include "preprocess/preprocess.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr double kReadout = 0.028;  // seconds

Eigen::Isometry3d moving(const Eigen::Isometry3d& now, const Vector6d& velocity, double seconds) {
  return now * retract(velocity * seconds);
}

Vector6d fast() {
  Vector6d velocity;
  velocity << 0.9, -1.4, 1.1, 0.4, -0.3, 0.2;
  return velocity;
}

struct Errors {
  double depth = 0, color = 0;  // medians: meters, gray levels
};

Errors between(const Frame& a, const Frame& b) {
  std::vector<float> depth, color;
  for (std::size_t i = 0; i < a.depth.size(); ++i)
    if (a.depth[i] > 0 && b.depth[i] > 0) depth.push_back(std::abs(a.depth[i] - b.depth[i]));
  for (std::size_t i = 0; i < a.color.size(); ++i)
    if ((a.color[i] & 0xffffff) != 0 && (b.color[i] & 0xffffff) != 0)
      color.push_back(std::abs(static_cast<float>(a.color[i] & 0xff) - static_cast<float>(b.color[i] & 0xff)));
  const auto median = [](std::vector<float>& v) {
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return static_cast<double>(v[v.size() / 2]);
  };
  return {median(depth), median(color)};
}

Frame seen(const Rig& rig, const PoseAt& depth_pose, const PoseAt& color_pose) {
  const Scene scene = synthetic_scene("room");
  auto images = SceneRenderer(test_device(), scene, rig.depth).render(depth_pose, 0);
  Frame frame{.depth = std::move(images.depth), .color = std::move(images.color)};
  if (rig.color) frame.color = SceneRenderer(test_device(), scene, rig.color->camera).render(color_pose, 0).color;
  return frame;
}

/// Depth and color of the fusion image.
Frame fused(const Rig& rig, const Frame& frame, const Vector6d& velocity) {
  Preprocessor preprocessor(test_device(), rig, {}, 1, 0);
  const FramePyramid surface = preprocessor.preprocess(frame, at_velocity(velocity));
  surface.register_color_to_depth();
  Frame fused;
  for (const auto& [depth, color] : download<shader::uvec2>(*surface.fusion, frame.depth.size())) {
    fused.depth.push_back(std::bit_cast<float>(depth));
    fused.color.push_back(color);
  }
  return fused;
}

void expect_corrected(Rig rig) {
  const Eigen::Isometry3d now = synthetic_scene("room").world_from_camera(1.0);
  const Eigen::Isometry3d depth_from_color = rig.depth_from_color();
  const PoseAt still = [&](double) { return now; };
  const PoseAt still_color = [&](double) -> Eigen::Isometry3d { return now * depth_from_color; };
  const Frame truth = seen(rig, still, still_color);
  rig.depth.readout = kReadout;
  if (rig.color) rig.color->camera.readout = kReadout;
  const PoseAt moved = [&](double t) { return moving(now, fast(), t); };
  const PoseAt moved_color = [&](double t) -> Eigen::Isometry3d { return moving(now, fast(), t) * depth_from_color; };
  const Frame rolling = seen(rig, moved, moved_color);
  const Frame global = GlobalShutter(test_device(), rig)(rolling, at_velocity(fast()));
  const Errors before = between(rolling, truth), after = between(global, truth);
  std::printf("depth %.2f mm off, %.2f after; color %.1f levels off, %.1f after\n", 1000 * before.depth,
              1000 * after.depth, before.color, after.color);
  EXPECT_GT(before.depth, 0.005);
  EXPECT_LT(after.depth, 0.04 * before.depth);
  EXPECT_LT(after.color, 0.5 * before.color);
  // The rectified fusion image equals the image of a static camera.
  const Frame expected = fused(rig, truth, Vector6d::Zero());
  const Errors without = between(fused(rig, rolling, Vector6d::Zero()), expected),
               with = between(fused(rig, rolling, fast()), expected);
  std::printf("fused: depth %.2f mm off, %.2f after; color %.1f levels off, %.1f after\n", 1000 * without.depth,
              1000 * with.depth, without.color, with.color);
  EXPECT_LT(with.depth, 0.1 * without.depth);
  EXPECT_LT(with.color, 0.5 * without.color);
}

TEST(GlobalShutter, CorrectsAFastRotationOfDepthAndRegisteredColor) { expect_corrected(small_camera()); }

TEST(GlobalShutter, CorrectsWithDistortionAndASeparateColorCamera) {
  Camera bent = small_camera(), beside = synthetic_camera();
  bent.distortion = {0.1, -0.2, 0.001, -0.001, 0.05};
  Eigen::Isometry3d color_from_depth = Eigen::Isometry3d::Identity();
  color_from_depth.translation() = Eigen::Vector3d(-0.05, 0, 0);
  expect_corrected({bent, ColorCamera{.camera = beside, .color_from_depth = color_from_depth}});
}

TEST(GlobalShutter, IsNotNeededWithoutReadoutTime) {
  EXPECT_FALSE(is_rolling(small_camera()));
  Camera rolling = small_camera();
  rolling.readout = kReadout;
  EXPECT_TRUE(is_rolling(rolling));
  EXPECT_FALSE(is_rolling(with_global_shutter(rolling)));
  EXPECT_NEAR(shutter_difference(rolling, at_velocity(fast()), at_velocity(fast())), 0, 1e-12);
  EXPECT_GT(shutter_difference(rolling, at_velocity(fast()), at_velocity(-fast())), 5);
}

TEST(ShutterMotion, FitsAnAcceleratedMotion) {
  Vector6d change;
  change << 8, -6, 9, 3, 2, -4;  // rad/s^2, m/s^2
  const MotionAt motion = [&](double delay) { return retract(fast() * delay + 0.5 * change * delay * delay); };
  const shader::ShutterMotion fitted = shutter_motion(motion, kReadout);
  for (const double delay : {-0.5 * kReadout, -0.004, 0.0, 0.01}) {
    const Eigen::Vector3f turn = delay * (Eigen::Vector3f(fitted.turn) + delay * Eigen::Vector3f(fitted.turn_change));
    EXPECT_LT((turn.cast<double>() - local_coordinates(motion(delay)).head<3>()).norm(), 1e-6);
  }
}

TEST(GlobalShutter, BarelyChangesImagesOfAStaticCamera) {
  Camera rolling = small_camera();
  rolling.readout = kReadout;
  const Frame frame = scene_frame(synthetic_scene("room"), small_camera(), 0);
  const Frame global = GlobalShutter(test_device(), rolling)(frame, at_velocity(Vector6d::Zero()));
  const Errors errors = between(frame, global);
  EXPECT_LT(errors.depth, 1e-6);
  EXPECT_EQ(errors.color, 0);
}

}  // namespace
}  // namespace cairn
