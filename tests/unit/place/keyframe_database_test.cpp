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

TEST(KeyframeDatabase, WaitsForFeaturesOfOtherThreads) {
  const auto features = [](std::uint8_t seed) {
    Features f;
    for (std::uint8_t i = 0; i < 40; ++i) {
      f.rays.emplace_back(0.01 * i, 0);
      f.points.emplace_back(0.01 * i, 0, 1);
      f.descriptors.push_back({});
      for (std::size_t k = 0; k < 32; ++k)
        f.descriptors.back()[k] = static_cast<std::uint8_t>(7 * seed + 31 * i + 13 * k * seed);
    }
    return f;
  };
  const auto later = [](Features f) {
    return std::async(std::launch::async, [f = std::move(f)] { return std::make_shared<const Features>(f); }).share();
  };
  KeyframeDatabase places;
  places.add(Eigen::Isometry3d::Identity(), later(features(1)));
  const FutureFeatures failed = std::async(
      std::launch::async, []() -> std::shared_ptr<const Features> { throw std::runtime_error("no memory"); });
  places.add(Eigen::Isometry3d::Identity(), failed);
  places.add(Eigen::Isometry3d::Identity(), later(features(2)));
  const auto found = places.query(features(2), 1);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].entry, 2u);
  EXPECT_EQ(places.indexed(), 3u);
  EXPECT_TRUE(features_or_none(failed)->rays.empty());
}

}  // namespace
}  // namespace cairn
