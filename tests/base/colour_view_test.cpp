// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/colour_view.hpp"

#include <gtest/gtest.h>

#include "cairn/synthetic.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

TEST(ColourView, HasTheDepthThatTheColourCameraWouldMeasure) {
  Rig rig(small_camera(),
          ColourCamera{.camera = {.width = 640, .height = 400, .fx = 480, .fy = 480, .cx = 319.5, .cy = 199.5}});
  rig.colour->colour_from_depth =
      Eigen::Translation3d(-0.05, 0.01, 0.005) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  const Scene scene = synthetic_scene("room");
  Frame frame = scene_frame(scene, rig.depth, 0);
  SceneCamera beside(scene, rig.colour->camera);
  const SceneImages expected = beside.look(*frame.world_from_camera * rig.depth_from_colour());
  frame.colour = expected.colour;
  const Frame seen = ColourView(rig)(frame);
  EXPECT_EQ(seen.colour, frame.colour);
  ASSERT_EQ(seen.depth.size(), expected.depth.size());
  std::size_t known = 0, right = 0;
  for (std::size_t i = 0; i < seen.depth.size(); ++i) {
    if (seen.depth[i] == 0) continue;
    ++known;
    right += std::abs(seen.depth[i] - expected.depth[i]) < 0.02f;
  }
  EXPECT_GT(static_cast<double>(known), 0.85 * static_cast<double>(seen.depth.size()));
  EXPECT_GT(static_cast<double>(right), 0.97 * static_cast<double>(known));
}

TEST(ColourView, LeavesARegisteredFrameAsItIs) {
  const Frame frame = scene_frame(synthetic_scene("room"), small_camera(), 0);
  const Frame seen = ColourView(small_camera())(frame);
  EXPECT_EQ(seen.depth, frame.depth);
  EXPECT_EQ(seen.colour, frame.colour);
}

}  // namespace
}  // namespace cairn
