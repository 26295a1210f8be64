// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/upright.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "map/atlas.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
using Source = Upright::Source;

/// Corner of a room, seen by a level camera in a rotated world.
struct Corner {
  explicit Corner(const Eigen::Quaterniond& turn) {
    for (const Vector3d& n : {Vector3d(0, -1, 0), Vector3d(-0.6, 0, -0.8), Vector3d(0.8, 0, -0.6)})
      structure.facings.push_back({.normal = n.cast<float>(), .area = 3});
    structure.area = 9;
    evidence.views.push_back({turn.toRotationMatrix(), &structure});
    evidence.world_from_first_camera = turn.toRotationMatrix();
  }
  Structure structure;
  DownEvidence evidence;
};

Eigen::Quaterniond turn(double angle, const Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

TEST(Upright, TurnsTheAxisThatIsAskedForToMinusY) {
  const Corner corner(turn(0.3, {1, 1, 0}));
  const std::pair<const char*, Vector3d> ups[]{{"x", Vector3d::UnitX()},   {"y", Vector3d::UnitY()},
                                               {"z", Vector3d::UnitZ()},   {"-x", -Vector3d::UnitX()},
                                               {"-y", -Vector3d::UnitY()}, {"-z", -Vector3d::UnitZ()}};
  for (const auto& [name, up] : ups) {
    const auto found = find_down(corner.evidence, up_of(name));
    ASSERT_TRUE(found) << name;
    const Upright upright = upright_by(*found, corner.evidence);
    EXPECT_LT((upright.world_from_tracked * up + Vector3d::UnitY()).norm(), 1e-9) << name;
    EXPECT_EQ(upright.source, Source::option);
    EXPECT_TRUE(upright.known);
    EXPECT_NE(upright.words.find(name), std::string::npos) << upright.words;
  }
  const Upright as_held = upright_by(*find_down(corner.evidence, Up::camera), corner.evidence);
  EXPECT_LT((as_held.world_from_tracked * corner.evidence.world_from_first_camera.col(1) - Vector3d::UnitY()).norm(),
            1e-9);
  EXPECT_EQ(upright_by(*find_down(corner.evidence, Up::minus_y), corner.evidence).turned(), 0);
  EXPECT_NE(error_of([] { (void)up_of("up"); }).find("-z"), std::string::npos);
}

TEST(Upright, TurnsByTheShortestWay) {
  const Corner corner(turn(29 * kDegree, {1, 0, 0.2}));
  const auto found = find_down(corner.evidence, Up::automatic);
  ASSERT_TRUE(found);
  const Upright upright = upright_by(*found, corner.evidence);
  EXPECT_EQ(upright.source, Source::structure);
  EXPECT_NEAR(upright.turned(), 29 * kDegree, 1e-5);
  EXPECT_FALSE(upright.off);  // no accelerometer
}

TEST(Upright, BelievesAnAccelerometerBeforeFloorsAndWallsAndSharpensItByThem) {
  const Eigen::Quaterniond held = turn(0.4, {1, 0, 0.2});
  Corner corner(held);
  const auto measure = [&](double off) {
    const Vector3d up = held * turn(off, {1, 0, 0}) * -Vector3d::UnitY();
    corner.evidence.accelerations << 981 * up, 990;
    const auto found = find_down(corner.evidence, Up::automatic);
    EXPECT_EQ(found->source, Source::accelerometer);
    return std::pair(std::acos(std::min(1.0, -found->down.dot(up))), *upright_by(*found, corner.evidence).off);
  };
  const auto [from_near, off_near] = measure(2 * kDegree);
  EXPECT_NEAR(from_near, 2 * kDegree, 1e-4);  // floor and walls correct the rest
  EXPECT_NEAR(off_near, 2 * kDegree, 1e-4);
  const auto [from_far, off_far] = measure(20 * kDegree);
  EXPECT_LT(from_far, 1e-6);  // on contradiction the accelerometer wins
  EXPECT_LT(off_far, 1e-6);
}

TEST(Upright, LeavesOutAnAccelerometerThatTurnsWithTheCamera) {
  Corner corner(Eigen::Quaterniond::Identity());
  corner.evidence.accelerations << 0, 0, 500, 990;  // readings in all directions
  EXPECT_EQ(find_down(corner.evidence, Up::automatic)->source, Source::structure);
}

TEST(Upright, TellsWhetherTheWorldOfGivenPosesStands) {
  const Upright stands = upright_as_given(Corner(turn(0.02, {1, 0, 0})).evidence);
  EXPECT_TRUE(stands.known);
  EXPECT_EQ(stands.turned(), 0);
  const Upright z_up = upright_as_given(Corner(turn(90 * kDegree, {-1, 0, 0})).evidence);
  EXPECT_FALSE(z_up.known);
  EXPECT_NE(z_up.words.find("Options::up z"), std::string::npos) << z_up.words;
  const Upright tilted = upright_as_given(Corner(turn(0.5, {1, 0, 0})).evidence);
  EXPECT_FALSE(tilted.known);
  EXPECT_NE(tilted.words.find("Options::up auto"), std::string::npos) << tilted.words;
  const Upright nothing = upright_as_given({});
  EXPECT_FALSE(nothing.known);
  EXPECT_EQ(nothing.source, Source::poses);
}

/// Atlas with keyframes that see the corner.
Atlas atlas_of(const Eigen::Quaterniond& held) {
  const Corner corner(held);
  Atlas atlas;
  for (int k = 0; k < 3; ++k) {
    Eigen::Isometry3d pose(held);
    pose.translation().x() = 0.2 * k;
    atlas.add({.timestamp = 0.1 * k,
               .follows = k > 0,
               .odometry_from_camera = pose,
               .submap_from_camera = pose,
               .structure = corner.structure});
    atlas.add_frame(0.1 * k, pose);
  }
  return atlas;
}

TEST(AtlasUpright, StaysAsItWasSettledWhateverComesLater) {
  Atlas atlas = atlas_of(turn(0.3, {1, 0, 0}));
  atlas.settle_upright();
  const Upright before = atlas.upright();
  for (Keyframe& keyframe : atlas.keyframes)
    for (auto& facing : keyframe.structure.facings) facing.normal = turn(0.05, {0, 0, 1}).cast<float>() * facing.normal;
  EXPECT_EQ(atlas.upright().world_from_tracked.coeffs(), before.world_from_tracked.coeffs());
  atlas.settled.reset();
  EXPECT_GT(atlas.upright().world_from_tracked.angularDistance(before.world_from_tracked), 0.04);
}

TEST(AtlasUpright, GoesWithItsKeyframesWhereThePoseGraphTurnsThem) {
  Atlas atlas = atlas_of(turn(0.3, {1, 0, 0}));
  atlas.settle_upright();
  for (Eigen::Isometry3d& pose : atlas.world_from_camera) pose = turn(0.1, {0, 0, 1}) * pose;
  const Vector3d down = atlas.world_from_camera[0].linear() * Vector3d::UnitY();
  EXPECT_LT((atlas.upright().world_from_tracked * down - Vector3d::UnitY()).norm(), 1e-6);
}

TEST(AtlasUpright, IsOpenAsLongAsNothingTells) {
  Atlas atlas;
  EXPECT_FALSE(atlas.upright().known);
  atlas = atlas_of(turn(0.3, {1, 0, 0}));
  for (Keyframe& keyframe : atlas.keyframes) keyframe.structure = {};
  atlas.settle_upright();
  EXPECT_FALSE(atlas.settled);
  EXPECT_EQ(atlas.upright().source, Source::unknown);
  EXPECT_EQ(atlas.upright().turned(), 0);
  EXPECT_NE(atlas.upright().words.find("Options::up"), std::string::npos);
}

TEST(AtlasUpright, SumsWhatAnAccelerometerMeasuresWhereverTheCameraTurns) {
  Atlas atlas = atlas_of(Eigen::Quaterniond::Identity());
  for (Keyframe& keyframe : atlas.keyframes) keyframe.structure = {};
  for (int i = 0; i < 20; ++i) {  // measures the same gravity in different orientations
    const Eigen::Isometry3d pose(turn(0.2 * i, {0.3, 1, 0.1}));
    atlas.add_frame(0.3 + 0.01 * i, pose, pose.linear().transpose() * Vector3d(0, -9.7, 1));
  }
  const Upright upright = atlas.upright();
  EXPECT_EQ(upright.source, Source::accelerometer);
  EXPECT_LT((upright.world_from_tracked * Vector3d(0, 9.7, -1).normalized() - Vector3d::UnitY()).norm(), 1e-5);
}

}  // namespace
}  // namespace cairn
