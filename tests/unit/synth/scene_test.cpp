// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/synthetic/scene.hpp"

#include <gtest/gtest.h>

#include <map>

#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

// Depth is computed in 32 bits: at 5 m the error is a few units in the last place of a sum of squares.
constexpr double kExact = 1e-4;  // meters

class EveryScene : public testing::TestWithParam<const char*> {};

TEST_P(EveryScene, IsRenderedAtZeroDistance) {
  const Scene scene = synthetic_scene(GetParam());
  const Camera camera = small_camera();
  for (const int index : {0, 77, 200}) {
    const Frame frame = scene_frame(scene, camera, index);
    int seen = 0;
    for (int y = 0; y < camera.height; y += 3)
      for (int x = 0; x < camera.width; x += 3) {
        const float z = frame.depth[static_cast<std::size_t>(y * camera.width + x)];
        if (z == 0) continue;
        ++seen;
        const Eigen::Vector3d p = *frame.world_from_camera * (camera.ray(x, y) * z);
        ASSERT_NEAR(scene.distance(p), 0.0, kExact) << x << ' ' << y << " at " << p.transpose();
        // The space in front is empty.
        ASSERT_GT(scene.distance(*frame.world_from_camera * (camera.ray(x, y) * (0.9 * z))), 0.0);
      }
    EXPECT_GT(seen, 500);
  }
}

TEST_P(EveryScene, HasASlowCollisionFreePath) {
  const Scene scene = synthetic_scene(GetParam());
  for (double t = 0; t < 40; t += 1 / 30.0) {
    const Eigen::Isometry3d a = scene.world_from_camera(t), b = scene.world_from_camera(t + 1 / 30.0);
    ASSERT_GT(scene.distance(a.translation()), 0.25) << "at " << t << " s";
    ASSERT_LT((b.translation() - a.translation()).norm() * 30, 1.0) << "at " << t << " s";
    // Paths through rooms have glances aside at 160 degrees per second.
    ASSERT_LT(Eigen::AngleAxisd((a.inverse() * b).linear()).angle() * 30, scene.path.empty() ? 0.9 : 3.6)
        << "at " << t << " s";
  }
}

TEST_P(EveryScene, HasAnExactMesh) {
  constexpr std::size_t kMany = 500;  // solids; above, the solids around the path's start are sufficient
  Scene scene = synthetic_scene(GetParam());
  if (scene.solids.size() > kMany) scene = scene.around({scene.world_from_camera(0).translation()}, 2);
  const Mesh mesh = scene.surface(0.05f);
  ASSERT_GT(mesh.triangles.size(), 100u);
  for (const auto& t : mesh.triangles)
    for (const auto v : t) ASSERT_NEAR(scene.distance(mesh.positions[v].cast<double>()), 0.0, kExact);
}

INSTANTIATE_TEST_SUITE_P(All, EveryScene,
                         testing::Values("room", "flat", "twin-rooms", "sphere", "plane", "corridor", "loop", "door",
                                         "building?recording=1"),
                         [](const auto& parameter) {
                           std::string name = parameter.param;
                           std::erase_if(name, [](char c) { return std::isalnum(c) == 0; });
                           return name;
                         });

TEST(SyntheticScene, RejectsAnUnknownName) {
  EXPECT_NE(error_of([] { (void)synthetic_scene("castle"); }).find("choose room"), std::string::npos);
}

TEST(KinectNoise, GrowsQuadraticallyAndIsDeterministic) {
  const Camera camera = synthetic_camera();
  std::map<int, double> deviation;
  for (const int z : {1, 2, 4}) {
    SceneImages images;
    images.depth.assign(static_cast<std::size_t>(camera.width * camera.height), static_cast<float>(z));
    images.cosine.assign(images.depth.size(), 1.0f);
    images.color.assign(images.depth.size(), 0xff808080u);
    auto again = images;
    add_noise(images, camera, "kinect", 7, 3);
    add_noise(again, camera, "kinect", 7, 3);
    EXPECT_EQ(images.depth, again.depth);
    EXPECT_EQ(images.color, again.color);
    double squares = 0;
    for (const float d : images.depth) squares += (d - z) * (d - z);
    deviation[z] = std::sqrt(squares / static_cast<double>(images.depth.size()));
  }
  EXPECT_NEAR(deviation[2] / deviation[1], 4.0, 1.0);
  EXPECT_NEAR(deviation[4] / deviation[2], 4.0, 1.0);
  EXPECT_LT(deviation[1], 0.005);
}

}  // namespace
}  // namespace cairn
