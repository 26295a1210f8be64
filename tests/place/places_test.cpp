// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/places.hpp"

#include <gtest/gtest.h>

#include "cairn/pose.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

/// Views around the room, then again from places beside them.
struct Around {
  static constexpr int kViews = 24;
  Places places;
  std::vector<Features> again;
  explicit Around(bool colour) {
    const Scene scene = synthetic_scene("room");
    const Camera camera = synthetic_camera();
    SceneRenderer render(test_device(), scene, camera);
    for (int i = 0; i < kViews; ++i) {
      const Eigen::Isometry3d pose = scene.world_from_camera(i);
      Vector6d aside;
      aside << 0.03, -0.1, 0.05, 0.12, -0.05, 0.08;
      for (const bool second : {false, true}) {
        auto images = render(second ? pose * exponential(aside) : pose);
        add_kinect_noise(images, camera, second ? 2 : 1, i);
        if (!colour) images.colour.clear();
        Features features = describe(images.colour, images.depth, camera);
        if (second)
          again.push_back(std::move(features));
        else
          places.add({pose, std::move(features)});
      }
    }
  }
  [[nodiscard]] int found() const {
    int count = 0;
    for (std::size_t i = 0; i < kViews; ++i) {
      const auto alike = places.likest(again[i], 3);
      count += std::any_of(alike.begin(), alike.end(), [&](const auto& a) { return a.place == i; });
    }
    return count;
  }
};

TEST(Places, AreFoundByTheirCorners) {
  const Around around(true);
  EXPECT_GE(around.found(), 22);
  // And are told apart by how these lie.
  for (std::size_t i = 0; i < Around::kViews; i += 5) {
    const auto located = locate(around.places[i].features, around.again[i], synthetic_camera());
    ASSERT_TRUE(located) << i;
    EXPECT_NEAR(located->known_from_seen.translation().norm(), 0.15, 0.03);
  }
}

TEST(Places, AreFoundByDepthAlone) {
  const int found = Around(false).found();
  std::printf("%d of %d\n", found, Around::kViews);
  EXPECT_GE(found, 16);
}

TEST(Places, KeepToTheRangeThatIsAskedFor) {
  const Around around(true);
  for (const auto& alike : around.places.likest(around.again[5], 100, 7, 12)) {
    EXPECT_GE(alike.place, 7u);
    EXPECT_LT(alike.place, 12u);
  }
  EXPECT_TRUE(around.places.likest({}, 5).empty());
}

}  // namespace
}  // namespace cairn
