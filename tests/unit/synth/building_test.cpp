// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "cairn/io/source.hpp"
#include "cairn/synthetic/scene.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

constexpr double kStorey = 3;  // meters

using Key = std::tuple<float, float, float, float, float, float, float>;
Key key(const Scene::Solid& s) {
  return {s.center.x(), s.center.y(), s.center.z(), s.half_size.x(), s.half_size.y(), s.half_size.z(), s.yaw};
}
std::set<Key> keys(const Scene& scene) {
  std::set<Key> keys;
  for (const auto& s : scene.solids) keys.insert(key(s));
  return keys;
}

TEST(Building, DiffersBetweenRecordingsOnlyInDoors) {
  const Scene a = synthetic_scene("building?recording=3"), b = synthetic_scene("building?recording=4");
  ASSERT_EQ(a.solids.size(), b.solids.size());
  std::size_t differ = 0;
  for (std::size_t i = 0; i < a.solids.size(); ++i) {
    if (key(a.solids[i]) == key(b.solids[i])) continue;
    ++differ;
    // A door, which rotates about its hinge.
    EXPECT_NEAR(a.solids[i].half_size.x(), 0.43f, 1e-6);
    EXPECT_LT((a.solids[i].center - b.solids[i].center).norm(), 0.8f);
  }
  EXPECT_GT(differ, 5u);
  EXPECT_LE(differ, 42u);  // one per room, and two at the missing rooms at the end of storeys
  EXPECT_NE(a.path, b.path);
  EXPECT_EQ(keys(synthetic_scene("building?recording=3")), keys(a));
}

TEST(Building, HasIdenticalOffices) {
  // The screens on desks: each at the same place in its room.
  std::map<float, int> screens;  // by distance from the corridor
  for (const auto& s : synthetic_scene("building").solids)
    if (s.pattern == Scene::Pattern::patches && s.half_size.isApprox(Eigen::Vector3f(0.275f, 0.175f, 0.025f), 1e-5f))
      ++screens[std::round(1000 * std::abs(s.center.z()))];
  ASSERT_EQ(screens.size(), 1u);
  EXPECT_GT(screens.begin()->second, 15);
}

TEST(Building, HasStairsOnThePaths) {
  int with_stairs = 0;
  for (int recording = 0; recording < 20; ++recording) {
    const Scene scene = synthetic_scene("building?recording=" + std::to_string(recording));
    std::set<int> storeys;
    for (const auto& p : scene.path) {
      ASSERT_LT(p.y(), 0.05);
      ASSERT_GT(p.y(), -2 * kStorey - 0.05);
      storeys.insert(static_cast<int>(std::lround(-p.y() / kStorey)));
    }
    with_stairs += storeys.size() > 1;
  }
  EXPECT_GE(with_stairs, 3);
  EXPECT_LT(with_stairs, 20);
}

TEST(Building, HasCollisionFreePaths) {
  for (const char* name : {"building?recording=2&meters=60", "building?floors=1&rooms=5&recording=1&meters=60",
                           "building?floors=2&rooms=2&recording=7&meters=60"}) {
    const Scene scene = synthetic_scene(name);
    EXPECT_NEAR(scene.duration(), 120, 0.2);
    for (double t = 0; t < scene.duration(); t += 0.1)
      ASSERT_GT(scene.distance(scene.world_from_camera(t).translation()), 0.2) << name << " at " << t << " s";
  }
}

TEST(Building, SourceEndsWithItsPathAndHasGroundTruth) {
  const std::string name = "synthetic:building?recording=1&meters=3";
  const auto source = open_source(name, {.range = {.begin = 150}});
  const Trajectory truth = recorded_truth(name);
  ASSERT_EQ(source->size().value(), static_cast<int>(truth.size()) - 150);
  int frames = 0;
  while (const auto frame = source->next()) {
    EXPECT_EQ(frame->timestamp, truth[static_cast<std::size_t>(frame->index)].timestamp);
    ++frames;
  }
  EXPECT_EQ(frames, static_cast<int>(truth.size()) - 150);
}

TEST(SyntheticSource, HasTheNamedNoise) {
  const auto depth_of = [](const char* name) { return open_source(name)->next()->depth; };
  const auto exact = depth_of("synthetic:room");
  EXPECT_EQ(depth_of("synthetic:room?noise=none"), exact);
  EXPECT_NE(depth_of("synthetic:room?noise=kinect"), exact);
  EXPECT_EQ(error_of([] { (void)open_source("synthetic:room?noise=loud"); }),
            "unknown noise 'loud': choose kinect, tof, stereo, lidar or none");
}

TEST(Building, NamesTheInvalidOption) {
  const auto said = [](const char* name) { return error_of([&] { (void)synthetic_scene(name); }); };
  EXPECT_EQ(said("building?floor=3"),
            "synthetic building: unknown option 'floor': choose floors, rooms, recording or meters");
  EXPECT_EQ(said("building?rooms=many"), "synthetic building: rooms is many: give a number from 1 to 10000");
  EXPECT_EQ(said("building?rooms=2"),
            "synthetic building: 2 rooms are too few for 3 floors: give at least one room per floor");
}

}  // namespace
}  // namespace cairn
