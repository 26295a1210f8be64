// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "geometry/color_view.hpp"

#include <gtest/gtest.h>

#include "cairn/synthetic/synthetic.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

TEST(ColorView, ReprojectsDepthIntoColorCamera) {
  Rig rig(small_camera(),
          ColorCamera{.camera = {.width = 640, .height = 400, .fx = 480, .fy = 480, .cx = 319.5, .cy = 199.5}});
  rig.color->color_from_depth =
      Eigen::Translation3d(-0.05, 0.01, 0.005) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  const Scene scene = synthetic_scene("room");
  Frame frame = scene_frame(scene, rig.depth, 0);
  SceneCamera beside(scene, rig.color->camera);
  const SceneImages expected = beside.render(*frame.world_from_camera * rig.depth_from_color());
  frame.color = expected.color;
  const Frame seen = ColorView(rig)(frame);
  EXPECT_EQ(seen.color, frame.color);
  ASSERT_EQ(seen.depth.size(), expected.depth.size());
  std::size_t observed = 0, correct = 0;
  for (std::size_t i = 0; i < seen.depth.size(); ++i) {
    if (seen.depth[i] == 0) continue;
    ++observed;
    correct += std::abs(seen.depth[i] - expected.depth[i]) < 0.02f;
  }
  EXPECT_GT(static_cast<double>(observed), 0.85 * static_cast<double>(seen.depth.size()));
  EXPECT_GT(static_cast<double>(correct), 0.97 * static_cast<double>(observed));
}

TEST(ColorView, KeepsRegisteredFrame) {
  const Frame frame = scene_frame(synthetic_scene("room"), small_camera(), 0);
  const Frame seen = ColorView(small_camera())(frame);
  EXPECT_EQ(seen.depth, frame.depth);
  EXPECT_EQ(seen.color, frame.color);
}

}  // namespace
}  // namespace cairn
