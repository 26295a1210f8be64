// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gravity/align_gravity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "map/atlas.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
using Source = GravityAlignment::Source;

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
  GravityEvidence evidence;
};

Eigen::Quaterniond turn(double angle, const Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized()));
}

TEST(GravityAlignment, RotatesTheRequestedAxisToMinusY) {
  const Corner corner(turn(0.3, {1, 1, 0}));
  const std::pair<const char*, Vector3d> ups[]{{"x", Vector3d::UnitX()},   {"y", Vector3d::UnitY()},
                                               {"z", Vector3d::UnitZ()},   {"-x", -Vector3d::UnitX()},
                                               {"-y", -Vector3d::UnitY()}, {"-z", -Vector3d::UnitZ()}};
  for (const auto& [name, up] : ups) {
    const auto found = estimate_gravity(corner.evidence, parse_up(name));
    ASSERT_TRUE(found) << name;
    const GravityAlignment upright = gravity_alignment_of(*found, corner.evidence);
    EXPECT_LT((upright.world_from_tracked * up + Vector3d::UnitY()).norm(), 1e-9) << name;
    EXPECT_EQ(upright.source, Source::option);
    EXPECT_TRUE(upright.known);
    EXPECT_NE(upright.description.find(name), std::string::npos) << upright.description;
  }
  const GravityAlignment as_held =
      gravity_alignment_of(*estimate_gravity(corner.evidence, Up::camera), corner.evidence);
  EXPECT_LT((as_held.world_from_tracked * corner.evidence.world_from_first_camera.col(1) - Vector3d::UnitY()).norm(),
            1e-9);
  EXPECT_EQ(gravity_alignment_of(*estimate_gravity(corner.evidence, Up::minus_y), corner.evidence).rotation_angle(), 0);
  EXPECT_NE(error_of([] { (void)parse_up("up"); }).find("-z"), std::string::npos);
}

TEST(GravityAlignment, UsesTheShortestRotation) {
  const Corner corner(turn(29 * kDegree, {1, 0, 0.2}));
  const auto found = estimate_gravity(corner.evidence, Up::automatic);
  ASSERT_TRUE(found);
  const GravityAlignment upright = gravity_alignment_of(*found, corner.evidence);
  EXPECT_EQ(upright.source, Source::structure);
  EXPECT_NEAR(upright.rotation_angle(), 29 * kDegree, 1e-5);
  EXPECT_FALSE(upright.off);  // no accelerometer
}

TEST(GravityAlignment, PrefersTheAccelerometerAndRefinesItByStructure) {
  const Eigen::Quaterniond camera_rotation = turn(0.4, {1, 0, 0.2});
  Corner corner(camera_rotation);
  const auto measure = [&](double off) {
    const Vector3d up = camera_rotation * turn(off, {1, 0, 0}) * -Vector3d::UnitY();
    corner.evidence.accelerations << 981 * up, 990;
    const auto found = estimate_gravity(corner.evidence, Up::automatic);
    EXPECT_EQ(found->source, Source::accelerometer);
    return std::pair(std::acos(std::min(1.0, -found->down.dot(up))),
                     *gravity_alignment_of(*found, corner.evidence).off);
  };
  const auto [from_near, off_near] = measure(2 * kDegree);
  EXPECT_NEAR(from_near, 2 * kDegree, 1e-4);  // floor and walls correct the rest
  EXPECT_NEAR(off_near, 2 * kDegree, 1e-4);
  const auto [from_far, off_far] = measure(20 * kDegree);
  EXPECT_LT(from_far, 1e-6);  // on contradiction the accelerometer wins
  EXPECT_LT(off_far, 1e-6);
}

TEST(GravityAlignment, IgnoresAnAccelerometerThatRotatesWithTheCamera) {
  Corner corner(Eigen::Quaterniond::Identity());
  corner.evidence.accelerations << 0, 0, 500, 990;  // readings in all directions
  EXPECT_EQ(estimate_gravity(corner.evidence, Up::automatic)->source, Source::structure);
}

TEST(GravityAlignment, ReportsIfGivenPosesAreGravityAligned) {
  const GravityAlignment upright_poses = given_gravity_alignment(Corner(turn(0.02, {1, 0, 0})).evidence);
  EXPECT_TRUE(upright_poses.known);
  EXPECT_EQ(upright_poses.rotation_angle(), 0);
  const GravityAlignment z_up = given_gravity_alignment(Corner(turn(90 * kDegree, {-1, 0, 0})).evidence);
  EXPECT_FALSE(z_up.known);
  EXPECT_NE(z_up.description.find("Options::up z"), std::string::npos) << z_up.description;
  const GravityAlignment tilted = given_gravity_alignment(Corner(turn(0.5, {1, 0, 0})).evidence);
  EXPECT_FALSE(tilted.known);
  EXPECT_NE(tilted.description.find("Options::up auto"), std::string::npos) << tilted.description;
  const GravityAlignment nothing = given_gravity_alignment({});
  EXPECT_FALSE(nothing.known);
  EXPECT_EQ(nothing.source, Source::poses);
}

/// Atlas with keyframes that see the corner.
Atlas atlas_of(const Eigen::Quaterniond& camera_rotation) {
  const Corner corner(camera_rotation);
  Atlas atlas;
  for (int k = 0; k < 3; ++k) {
    Eigen::Isometry3d pose(camera_rotation);
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

TEST(AtlasGravity, StaysFrozen) {
  Atlas atlas = atlas_of(turn(0.3, {1, 0, 0}));
  atlas.freeze_gravity();
  const GravityAlignment before = atlas.upright();
  for (Keyframe& keyframe : atlas.keyframes)
    for (auto& facing : keyframe.structure.facings) facing.normal = turn(0.05, {0, 0, 1}).cast<float>() * facing.normal;
  EXPECT_EQ(atlas.upright().world_from_tracked.coeffs(), before.world_from_tracked.coeffs());
  atlas.frozen_gravity.reset();
  EXPECT_GT(atlas.upright().world_from_tracked.angularDistance(before.world_from_tracked), 0.04);
}

TEST(AtlasGravity, RotatesWithItsKeyframe) {
  Atlas atlas = atlas_of(turn(0.3, {1, 0, 0}));
  atlas.freeze_gravity();
  for (Eigen::Isometry3d& pose : atlas.world_from_camera) pose = turn(0.1, {0, 0, 1}) * pose;
  const Vector3d down = atlas.world_from_camera[0].linear() * Vector3d::UnitY();
  EXPECT_LT((atlas.upright().world_from_tracked * down - Vector3d::UnitY()).norm(), 1e-6);
}

TEST(AtlasGravity, IsUnknownWithoutEvidence) {
  Atlas atlas;
  EXPECT_FALSE(atlas.upright().known);
  atlas = atlas_of(turn(0.3, {1, 0, 0}));
  for (Keyframe& keyframe : atlas.keyframes) keyframe.structure = {};
  atlas.freeze_gravity();
  EXPECT_FALSE(atlas.frozen_gravity);
  EXPECT_EQ(atlas.upright().source, Source::unknown);
  EXPECT_EQ(atlas.upright().rotation_angle(), 0);
  EXPECT_NE(atlas.upright().description.find("Options::up"), std::string::npos);
}

TEST(AtlasGravity, SumsAccelerationsAcrossCameraRotations) {
  Atlas atlas = atlas_of(Eigen::Quaterniond::Identity());
  for (Keyframe& keyframe : atlas.keyframes) keyframe.structure = {};
  for (int i = 0; i < 20; ++i) {  // measures the same gravity in different orientations
    const Eigen::Isometry3d pose(turn(0.2 * i, {0.3, 1, 0.1}));
    atlas.add_frame(0.3 + 0.01 * i, pose, pose.linear().transpose() * Vector3d(0, -9.7, 1));
  }
  const GravityAlignment upright = atlas.upright();
  EXPECT_EQ(upright.source, Source::accelerometer);
  EXPECT_LT((upright.world_from_tracked * Vector3d(0, 9.7, -1).normalized() - Vector3d::UnitY()).norm(), 1e-5);
}

}  // namespace
}  // namespace cairn
