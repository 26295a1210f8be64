// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/keyframe_database.hpp"

#include <gtest/gtest.h>

#include "cairn/mapping/pose.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

/// Views around the room, then again from nearby poses.
struct Around {
  static constexpr int kViews = 24;
  KeyframeDatabase places;
  std::vector<Features> once, again;
  explicit Around(bool color) {
    const Scene scene = synthetic_scene("room");
    const Camera camera = synthetic_camera();
    SceneRenderer renderer(test_device(), scene, camera);
    for (int i = 0; i < kViews; ++i) {
      const Eigen::Isometry3d pose = scene.world_from_camera(i);
      Vector6d shift;
      shift << 0.03, -0.1, 0.05, 0.12, -0.05, 0.08;
      for (const bool second : {false, true}) {
        auto images = renderer.render(second ? pose * retract(shift) : pose);
        add_noise(images, camera, "kinect", second ? 2 : 1, i);
        if (!color) images.color.clear();
        Features features = extract_features(images.color, images.depth, camera);
        if (!second) places.add(pose, features);
        (second ? again : once).push_back(std::move(features));
      }
    }
  }
  [[nodiscard]] int found() const {
    int count = 0;
    for (std::size_t i = 0; i < kViews; ++i) {
      const auto similar = places.query(again[i], 3);
      count += std::any_of(similar.begin(), similar.end(), [&](const auto& a) { return a.entry == i; });
    }
    return count;
  }
};

TEST(KeyframeDatabase, FindsKeyframesByFeatures) {
  const Around around(true);
  EXPECT_GE(around.found(), 22);
  // The geometry of the corners distinguishes the places.
  for (std::size_t i = 0; i < Around::kViews; i += 5) {
    const auto located = solve_pnp(around.once[i], around.again[i], synthetic_camera());
    ASSERT_TRUE(located) << i;
    EXPECT_NEAR(located->known_from_seen.translation().norm(), 0.15, 0.03);
  }
}

TEST(KeyframeDatabase, FindsKeyframesByDepthAlone) {
  const int found = Around(false).found();
  std::printf("%d of %d\n", found, Around::kViews);
  EXPECT_GE(found, 16);
}

TEST(KeyframeDatabase, RespectsTheQueryRange) {
  Around around(true);
  for (const auto& candidate : around.places.query(around.again[5], 100, 7, 12)) {
    EXPECT_GE(candidate.entry, 7u);
    EXPECT_LT(candidate.entry, 12u);
  }
  EXPECT_TRUE(around.places.query({}, 5).empty());
  ASSERT_EQ(around.places.query(around.again[5], 1)[0].entry, 5u);
  around.places[5].tracked_from_camera.reset();
  const auto tracked = around.places.query_tracked(around.again[5], 100);
  EXPECT_GT(tracked.size(), 10u);
  EXPECT_TRUE(std::none_of(tracked.begin(), tracked.end(), [](const auto& a) { return a.entry == 5; }));
}

}  // namespace
}  // namespace cairn
