// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/join.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace cairn {
namespace {

constexpr std::size_t kLength = 40;  // keyframes of a map

Eigen::Isometry3d at(double x, double turn = 0) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY()).toRotationMatrix();
  pose.translation().x() = x;
  return pose;
}

/// Maps of 20 m each along a corridor, each in its own frame.
class JoinedMaps : public testing::Test {
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
  /// Adds a loop: keyframe `to` of map `b` is `off` meters from keyframe `from` of map `a`.
  void see(std::size_t a, std::size_t from, std::size_t b, std::size_t to, double off, double turn = 0,
           int corners = 50) {
    loops.push_back({.edge = {.i = a * kLength + from,
                              .j = b * kLength + to,
                              .i_from_j = at(off, turn),
                              .information = 1e4 * Matrix6d::Identity(),
                              .is_loop_closure = true},
                     .corners = corners});
  }
  [[nodiscard]] double x(std::size_t map, std::size_t keyframe) const {
    return atlas.world_from_camera[map * kLength + keyframe].translation().x();
  }
  [[nodiscard]] bool are_joined(std::size_t a, std::size_t b) const {
    const auto piece = atlas.components();
    return piece[a * kLength] == piece[b * kLength];
  }

  /// The keyframes of a map see a wall at a distance in meters; 0: no depth.
  std::size_t join() {
    const Camera camera{.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5};
    ViewsApart views(camera, [&](std::size_t k) { return std::vector<float>(64 * 48, walls[k / kLength]); });
    return join_pieces(atlas, loops, views);
  }

  Atlas atlas;
  std::size_t maps = 0;
  std::vector<float> walls = std::vector<float>(3, 0.0f);
  std::vector<Loop> loops;
};

TEST_F(JoinedMaps, LieAsMostLoopsSay) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 5; ++k) see(0, 10 + k, 1, k, 0.02);  // the second starts 5 m into the first
  see(0, 3, 1, 9, 0);                                              // rooms with the same appearance
  see(0, 4, 1, 10, 0);
  EXPECT_EQ(join(), 5u);
  EXPECT_TRUE(are_joined(0, 1));
  EXPECT_NEAR(x(1, 0), 5.02, 1e-9);
  EXPECT_EQ(atlas.loops.size(), 5u);
}

TEST_F(JoinedMaps, StayApartWhereNearlyAsManySaySomethingElse) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 5; ++k) see(0, 10 + k, 1, k, 0);
  for (std::size_t k = 0; k < 3; ++k) see(0, 2 + k, 1, 10 + k, 0);
  EXPECT_EQ(join(), 0u);
  EXPECT_FALSE(are_joined(0, 1));
}

TEST_F(JoinedMaps, StayApartForTwoLoops) {
  add_map(), add_map();
  see(0, 10, 1, 0, 0), see(0, 11, 1, 1, 0);
  EXPECT_EQ(join(), 0u);
}

TEST_F(JoinedMaps, AreHeldByAThirdOneWhereTwoAlikeRoomsLeaveItOpen) {
  add_map(), add_map(), add_map();
  for (std::size_t k = 0; k < 4; ++k) see(0, 10 + k, 1, k, 0);      // true
  for (std::size_t k = 0; k < 4; ++k) see(0, 2 + k, 1, 10 + k, 0);  // as many false loops
  for (std::size_t k = 0; k < 6; ++k) see(0, 5 + k, 2, k, 0);       // the third starts at 2.5 m
  for (std::size_t k = 0; k < 6; ++k) see(1, k, 2, 5 + k, 0);       // and agrees with the second
  EXPECT_EQ(join(), 16u);                                           // all but the false loops
  EXPECT_TRUE(are_joined(0, 1) && are_joined(0, 2));
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
    const auto grey = static_cast<std::uint32_t>(brightness * tiles[i / 320 / 2 * 160 + i % 320 / 2]);
    frame.colour.push_back(0xff000000u | grey << 16 | grey << 8 | grey);
  }
  return frame;
}

TEST_F(JoinedMaps, LieNowhereThatHasOtherPicturesOnItsWalls) {
  std::vector<unsigned> picture(2 * kLength, 0);  // by keyframe
  const auto views = [&] {
    return ViewsApart(
        {.width = 320, .height = 240, .fx = 300, .fy = 300, .cx = 159.5, .cy = 119.5},
        [](std::size_t) { return std::vector<float>(320 * 240, 0.0f); },  // depth alone cannot decide
        [&](std::size_t k) { return wall_with(picture[k], k < kLength ? 1.0f : 0.6f); });
  };
  add_map(), add_map();
  for (std::size_t k = 0; k < 9; ++k) see(0, 2 + k, 1, k, 0);              // most loops, to 1 m
  for (std::size_t k = 0; k < 8; ++k) see(0, 25 + k, 1, 9 + k, 0, 0, 60);  // nearly as many, to 8 m
  ViewsApart alike = views();
  EXPECT_EQ(join_pieces(atlas, loops, alike), 0u);
  for (std::size_t k = 0; k < 9; ++k) picture[2 + k] = 1, picture[kLength + k] = 2;
  ViewsApart other = views();
  EXPECT_GT(other.patterns(loops[0]).differ, 100);
  EXPECT_LT(other.patterns(loops[0]).agree, 10);
  EXPECT_GT(other.patterns(loops.back()).agree, 100);
  EXPECT_EQ(other.patterns(loops.back()).differ, 0);
  EXPECT_EQ(join_pieces(atlas, loops, other), 8u);
  EXPECT_NEAR(x(1, 0), 8, 1e-9);
}

TEST_F(JoinedMaps, LieNowhereThatOneSawThrough) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 9; ++k) see(0, 2 + k, 1, k, 0);  // most loops, to a place 1 m into the first
  for (std::size_t k = 0; k < 3; ++k) see(0, 30 + k, 1, 5 + k, 0.01);
  walls = {2, 2, 0};
  EXPECT_EQ(join(), 9u);
  EXPECT_NEAR(x(1, 0), 1, 1e-9);
  // The second map's wall is in the free space of the first: at 12.5 m only half of the wall is beside the first map.
  atlas = {}, loops.clear(), maps = 0;
  add_map(), add_map();
  for (std::size_t k = 0; k < 9; ++k) see(0, 2 + k, 1, k, 0);
  for (std::size_t k = 0; k < 3; ++k) see(0, 30 + k, 1, 5 + k, 0.01);
  walls = {3, 2, 0};
  EXPECT_EQ(join(), 3u);
  EXPECT_NEAR(x(1, 0), 12.51, 1e-9);
}

TEST_F(JoinedMaps, FollowTheViewsThatHaveMostInCommon) {
  add_map(), add_map();
  for (std::size_t k = 0; k < 4; ++k) see(0, 10 + k, 1, k, 0, 0, 300);
  for (std::size_t k = 0; k < 6; ++k) see(0, 2 + k, 1, 30 + k, 0, 0, 60);
  EXPECT_EQ(join(), 4u);
  EXPECT_NEAR(x(1, 0), 5, 1e-9);
}

TEST_F(JoinedMaps, AreComparedWhereTheySeeEachOther) {
  // A rotation of 2 degrees along a map displaces its end by 0.35 m, and points far from the origin much more.
  for (std::size_t m = 0; m < 2; ++m) add_map();
  for (Eigen::Isometry3d& pose : atlas.world_from_camera) pose = at(200) * pose;
  const double turn = 2 * std::numbers::pi / 180;
  for (std::size_t k = 0; k < 6; ++k) see(0, 10 + k, 1, k, 0, k < 3 ? 0 : turn);
  EXPECT_EQ(join(), 6u);
}

TEST_F(JoinedMaps, ThatDriftedAreStillClosedByMany) {
  add_map(), add_map(), add_map();
  for (std::size_t k = 0; k < 6; ++k) see(0, 14 + k, 1, k, 0);
  for (std::size_t k = 0; k < 5; ++k) see(1, 14 + k, 2, k, 0);
  for (std::size_t k = 0; k < 4; ++k) see(0, k, 2, k, 13.4);  // at 14 by the other loops
  see(0, 5, 2, 0, 12.2);                                      // 0.7 m off in the opposite direction, alone
  EXPECT_EQ(join(), 15u);
}

/// Components of one run: a keyframe a second, and three seconds lost between two components.
class PiecesOfARun : public JoinedMaps {
 protected:
  void add_piece() {
    add_map();
    for (std::size_t k = atlas.keyframes.size() - kLength; k < atlas.keyframes.size(); ++k) {
      atlas.keyframes[k].timestamp = static_cast<double>(k) + 2.0 * static_cast<double>(maps);
      atlas.keyframes[k].frame = static_cast<int>(30 * atlas.keyframes[k].timestamp);
    }
  }
  /// Adds loops between `count` keyframes of the first component and the second, from the given keyframes on, at the
  /// current poses.
  void see_some(std::size_t count, std::size_t from, std::size_t to, bool is_believed) {
    for (std::size_t k = 0; k < count; ++k) {
      see(0, from + k, 1, to + k, 0);
      loops.back().inlier = is_believed;
    }
  }
};

TEST_F(PiecesOfARun, StayApartWhereTheCameraWouldHaveJumped) {
  add_piece(), add_piece();
  see_some(10, 0, 0, true);  // back at the start within three seconds
  EXPECT_EQ(join(), 0u);
  for (auto& k : atlas.keyframes) k.timestamp = 0;  // as from two recordings
  EXPECT_EQ(join(), 10u);
}

TEST_F(PiecesOfARun, AreJoinedWhereItCanHaveGone) {
  add_piece(), add_piece();
  see_some(4, 36, 2, true);
  EXPECT_EQ(join(), 4u);
  EXPECT_NEAR(x(1, 0), 17, 1e-9);
}

TEST_F(PiecesOfARun, AreJoinedAnewWhereMuchIsNotBelieved) {
  add_piece(), add_piece();
  see_some(30, 0, 5, true);  // earlier loops: a corridor of the same appearance
  atlas.join(loops.front().edge);
  see_some(19, 21, 0, false);
  atlas.loops = loops;
  EXPECT_FALSE(contradict_each_other(atlas));
  see_some(6, 30, 9, false);
  atlas.loops = loops;
  ASSERT_TRUE(contradict_each_other(atlas));
  ASSERT_NEAR(x(1, 0), -2.5, 1e-9);
  ViewsApart views({.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5},
                   [](std::size_t) { return std::vector<float>(64 * 48, 0.0f); });
  join_anew(atlas, views);
  EXPECT_EQ(atlas.loops.size(), 0u) << "both would be jumps";
  EXPECT_FALSE(are_joined(0, 1));
}

TEST_F(PiecesOfARun, ThatAreJoinedAnewKeepTheLoopsThatAgree) {
  add_piece(), add_piece();
  see_some(30, 0, 5, true);
  atlas.join(loops.front().edge);
  for (int i = 0; i < 4; ++i) see_some(7, 33, 0, false);
  atlas.loops = loops;
  ASSERT_TRUE(contradict_each_other(atlas));
  ViewsApart views({.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5},
                   [](std::size_t) { return std::vector<float>(64 * 48, 0.0f); });
  join_anew(atlas, views);
  EXPECT_EQ(atlas.loops.size(), 28u);
  EXPECT_TRUE(are_joined(0, 1));
  EXPECT_NEAR(x(1, 0) - x(0, 0), 16.5, 1e-3);
  EXPECT_FALSE(contradict_each_other(atlas));
}

}  // namespace
}  // namespace cairn
