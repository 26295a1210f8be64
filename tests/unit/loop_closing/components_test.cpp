// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "loop_closing/components.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace cairn {
namespace {

constexpr std::size_t kLength = 40;  // keyframes of a map

Eigen::Isometry3d at(double x, double angle = 0) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
  pose.translation().x() = x;
  return pose;
}

/// Maps of 20 m each along a corridor, each in its own frame.
class MergedMaps : public testing::Test {
 protected:
  void add_map() {
    for (std::size_t k = 0; k < kLength; ++k)
      atlas.add({.submap = maps,
                 .follows = k > 0,
                 .odometry_from_camera = at(0.5 * static_cast<double>(k)),
                 .submap_from_camera = at(0.5 * static_cast<double>(k)),
                 .information = 1e4 * Matrix6d::Identity()});
    ++maps;
  }
  /// Adds a loop: keyframe `to` of map `b` is `offset` meters from keyframe `from` of map `a`.
  void see(std::size_t a, std::size_t from, std::size_t b, std::size_t to, double offset, double angle = 0,
           int feature_inliers = 50) {
    loops.push_back({.edge = {.i = a * kLength + from,
                              .j = b * kLength + to,
                              .i_from_j = at(offset, angle),
                              .information = 1e4 * Matrix6d::Identity(),
                              .is_loop_closure = true},
                     .feature_inliers = feature_inliers});
  }
  [[nodiscard]] double x(std::size_t map, std::size_t keyframe) const {
    return atlas.world_from_camera[map * kLength + keyframe].translation().x();
  }
  [[nodiscard]] bool are_merged(std::size_t a, std::size_t b) const {
    const auto component = atlas.components();
    return component[a * kLength] == component[b * kLength];
  }

  /// The keyframes of a map see a wall at a distance in meters; 0: no depth.
  std::size_t merge() {
    const Camera camera{.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5};
    FreeSpaceConflicts views(camera, [&](std::size_t k) { return std::vector<float>(64 * 48, walls[k / kLength]); });
    return merge_components(atlas, loops, views);
  }

  Atlas atlas;
  std::size_t maps = 0;
  std::vector<float> walls = std::vector<float>(3, 0.0f);
  std::vector<Loop> loops;
};

TEST_F(MergedMaps, FollowTheMajorityOfLoops) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 5; ++k) see(0, 10 + k, 1, k, 0.02);  // the second starts 5 m into the first
  see(0, 3, 1, 9, 0);                                              // rooms with the same appearance
  see(0, 4, 1, 10, 0);
  EXPECT_EQ(merge(), 5u);
  EXPECT_TRUE(are_merged(0, 1));
  EXPECT_NEAR(x(1, 0), 5.02, 1e-9);
  EXPECT_EQ(atlas.loops.size(), 5u);
}

TEST_F(MergedMaps, StaySeparateIfLoopsAreAmbiguous) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 5; ++k) see(0, 10 + k, 1, k, 0);
  for (std::size_t k = 0; k < 3; ++k) see(0, 2 + k, 1, 10 + k, 0);
  EXPECT_EQ(merge(), 0u);
  EXPECT_FALSE(are_merged(0, 1));
}

TEST_F(MergedMaps, StaySeparateWithTwoLoops) {
  add_map(), add_map();
  see(0, 10, 1, 0, 0), see(0, 11, 1, 1, 0);
  EXPECT_EQ(merge(), 0u);
}

TEST_F(MergedMaps, AreDisambiguatedByAThirdMap) {
  add_map(), add_map(), add_map();
  for (std::size_t k = 0; k < 4; ++k) see(0, 10 + k, 1, k, 0);      // true
  for (std::size_t k = 0; k < 4; ++k) see(0, 2 + k, 1, 10 + k, 0);  // as many false loops
  for (std::size_t k = 0; k < 6; ++k) see(0, 5 + k, 2, k, 0);       // the third starts at 2.5 m
  for (std::size_t k = 0; k < 6; ++k) see(1, k, 2, 5 + k, 0);       // and agrees with the second
  EXPECT_EQ(merge(), 16u);                                          // all but the false loops
  EXPECT_TRUE(are_merged(0, 1) && are_merged(0, 2));
  EXPECT_NEAR(x(1, 0), 5, 1e-9);
}

/// Wall at 2 m with a pattern given by a number; brighter or darker.
Frame wall_with(unsigned picture, float brightness) {
  std::mt19937 random(picture);
  Frame frame;
  frame.depth.assign(320 * 240, 2.0f);
  std::vector<float> tiles(160 * 120);
  for (float& tile : tiles) tile = static_cast<float>(random() % 160);
  for (std::size_t i = 0; i < frame.depth.size(); ++i) {
    const auto gray = static_cast<std::uint32_t>(brightness * tiles[i / 320 / 2 * 160 + i % 320 / 2]);
    frame.color.push_back(0xff000000u | gray << 16 | gray << 8 | gray);
  }
  return frame;
}

TEST_F(MergedMaps, RejectAnAlignmentWithDifferentPatterns) {
  std::vector<unsigned> picture(2 * kLength, 0);  // by keyframe
  const auto views = [&] {
    return FreeSpaceConflicts(
        {.width = 320, .height = 240, .fx = 300, .fy = 300, .cx = 159.5, .cy = 119.5},
        [](std::size_t) { return std::vector<float>(320 * 240, 0.0f); },  // depth alone cannot decide
        [&](std::size_t k) { return wall_with(picture[k], k < kLength ? 1.0f : 0.6f); });
  };
  add_map(), add_map();
  for (std::size_t k = 0; k < 9; ++k) see(0, 2 + k, 1, k, 0);              // most loops, to 1 m
  for (std::size_t k = 0; k < 8; ++k) see(0, 25 + k, 1, 9 + k, 0, 0, 60);  // nearly as many, to 8 m
  FreeSpaceConflicts similar = views();
  EXPECT_EQ(merge_components(atlas, loops, similar), 0u);
  for (std::size_t k = 0; k < 9; ++k) picture[2 + k] = 1, picture[kLength + k] = 2;
  FreeSpaceConflicts other = views();
  EXPECT_GT(other.patterns(loops[0]).differ, 100);
  EXPECT_LT(other.patterns(loops[0]).agree, 10);
  EXPECT_GT(other.patterns(loops.back()).agree, 100);
  EXPECT_EQ(other.patterns(loops.back()).differ, 0);
  EXPECT_EQ(merge_components(atlas, loops, other), 8u);
  EXPECT_NEAR(x(1, 0), 8, 1e-9);
}

TEST_F(MergedMaps, RejectAnAlignmentThroughFreeSpace) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 9; ++k) see(0, 2 + k, 1, k, 0);  // most loops, to a place 1 m into the first
  for (std::size_t k = 0; k < 3; ++k) see(0, 30 + k, 1, 5 + k, 0.01);
  walls = {2, 2, 0};
  EXPECT_EQ(merge(), 9u);
  EXPECT_NEAR(x(1, 0), 1, 1e-9);
  // The second map's wall is in the free space of the first: at 12.5 m only half of the wall is beside the first map.
  atlas = {}, loops.clear(), maps = 0;
  add_map(), add_map();
  for (std::size_t k = 0; k < 9; ++k) see(0, 2 + k, 1, k, 0);
  for (std::size_t k = 0; k < 3; ++k) see(0, 30 + k, 1, 5 + k, 0.01);
  walls = {3, 2, 0};
  EXPECT_EQ(merge(), 3u);
  EXPECT_NEAR(x(1, 0), 12.51, 1e-9);
}

TEST_F(MergedMaps, PreferLoopsWithTheMostFeatureInliers) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 4; ++k) see(0, 10 + k, 1, k, 0, 0, 300);
  for (std::size_t k = 0; k < 6; ++k) see(0, 2 + k, 1, 30 + k, 0, 0, 60);
  EXPECT_EQ(merge(), 4u);
  EXPECT_NEAR(x(1, 0), 5, 1e-9);
}

TEST_F(MergedMaps, AreComparedAtOverlappingViews) {
  // A rotation of 2 degrees along a map displaces its end by 0.35 m, and points far from the origin much more.
  for (std::size_t m = 0; m < 2; ++m) add_map();
  for (Eigen::Isometry3d& pose : atlas.world_from_camera) pose = at(200) * pose;
  const double angle = 2 * std::numbers::pi / 180;
  for (std::size_t k = 0; k < 6; ++k) see(0, 10 + k, 1, k, 0, k < 3 ? 0 : angle);
  EXPECT_EQ(merge(), 6u);
}

TEST_F(MergedMaps, AcceptManyLoopsDespiteDrift) {
  add_map(), add_map(), add_map();
  for (std::size_t k = 0; k < 6; ++k) see(0, 14 + k, 1, k, 0);
  for (std::size_t k = 0; k < 5; ++k) see(1, 14 + k, 2, k, 0);
  for (std::size_t k = 0; k < 4; ++k) see(0, k, 2, k, 13.4);  // at 14 by the other loops
  see(0, 5, 2, 0, 12.2);                                      // 0.7 m off in the opposite direction, alone
  EXPECT_EQ(merge(), 15u);
}

/// Components of one run: a keyframe a second, and three seconds lost between two components.
class ComponentsOfARun : public MergedMaps {
 protected:
  void add_component() {
    add_map();
    for (std::size_t k = atlas.keyframes.size() - kLength; k < atlas.keyframes.size(); ++k) {
      atlas.keyframes[k].timestamp = static_cast<double>(k) + 2.0 * static_cast<double>(maps);
      atlas.keyframes[k].frame = static_cast<int>(30 * atlas.keyframes[k].timestamp);
    }
  }
  /// Adds loops between `count` keyframes of the first component and the second, from the given keyframes on, at the
  /// current poses.
  void see_some(std::size_t count, std::size_t from, std::size_t to, bool is_inlier) {
    for (std::size_t k = 0; k < count; ++k) {
      see(0, from + k, 1, to + k, 0);
      loops.back().inlier = is_inlier;
    }
  }
};

TEST_F(ComponentsOfARun, StaySeparateIfTheCameraWouldHaveJumped) {
  add_component(), add_component();
  see_some(10, 0, 0, true);  // back at the start within three seconds
  EXPECT_EQ(merge(), 0u);
  for (auto& k : atlas.keyframes) k.timestamp = 0;  // as from two recordings
  EXPECT_EQ(merge(), 10u);
}

TEST_F(ComponentsOfARun, AreMergedWithinReach) {
  add_component(), add_component();
  see_some(4, 36, 2, true);
  EXPECT_EQ(merge(), 4u);
  EXPECT_NEAR(x(1, 0), 17, 1e-9);
}

TEST_F(ComponentsOfARun, AreRemergedAfterManyRejectedLoops) {
  add_component(), add_component();
  see_some(30, 0, 5, true);  // earlier loops: a corridor of the same appearance
  atlas.align_components(loops.front().edge);
  see_some(19, 21, 0, false);
  atlas.loops = loops;
  EXPECT_FALSE(has_inconsistent_loops(atlas));
  see_some(6, 30, 9, false);
  atlas.loops = loops;
  ASSERT_TRUE(has_inconsistent_loops(atlas));
  ASSERT_NEAR(x(1, 0), -2.5, 1e-9);
  FreeSpaceConflicts views({.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5},
                           [](std::size_t) { return std::vector<float>(64 * 48, 0.0f); });
  remerge_components(atlas, views);
  EXPECT_EQ(atlas.loops.size(), 0u) << "both would be jumps";
  EXPECT_FALSE(are_merged(0, 1));
}

TEST_F(ComponentsOfARun, KeepConsistentLoopsWhenRemerged) {
  add_component(), add_component();
  see_some(30, 0, 5, true);
  atlas.align_components(loops.front().edge);
  for (int i = 0; i < 4; ++i) see_some(7, 33, 0, false);
  atlas.loops = loops;
  ASSERT_TRUE(has_inconsistent_loops(atlas));
  FreeSpaceConflicts views({.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5},
                           [](std::size_t) { return std::vector<float>(64 * 48, 0.0f); });
  remerge_components(atlas, views);
  EXPECT_EQ(atlas.loops.size(), 28u);
  EXPECT_TRUE(are_merged(0, 1));
  EXPECT_NEAR(x(1, 0) - x(0, 0), 16.5, 1e-3);
  EXPECT_FALSE(has_inconsistent_loops(atlas));
}

}  // namespace
}  // namespace cairn
