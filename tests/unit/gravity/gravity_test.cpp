// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gravity vote on exact shapes: views of surfaces with known directions, in a tilted world.
#include "gravity/gravity.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <deque>
#include <numbers>
#include <random>

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kExact = 0.01 * kDegree;  // single precision of the facings

const Vector3d kUp = -Vector3d::UnitY(), kDown = Vector3d::UnitY(), kLeft = -Vector3d::UnitX(),
               kRight = Vector3d::UnitX(), kBack = -Vector3d::UnitZ(), kAhead = Vector3d::UnitZ();

struct FlatSurface {
  Vector3d normal;  // with y down
  double area;
};

Matrix3d turn(double angle, const Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

/// Camera that looks around once, in steps, at a pitch (down) with some variation; each view contains the surfaces
/// facing it.
class Walk {
 public:
  Walk(const std::vector<FlatSurface>& surfaces, double pitch, const Matrix3d& tilt = Matrix3d::Identity(),
       double noise = 0, double around = 360) {
    constexpr int kViews = 16;
    for (int i = 0; i < kViews; ++i) {
      const double wobble = 8 * kDegree * std::sin(2.1 * i);
      const Matrix3d camera = turn(kDegree * around * i / kViews, kUp) * turn(-pitch + wobble, Vector3d::UnitX()) *
                              turn(wobble / 2, Vector3d::UnitZ());
      Structure& structure = structures_.emplace_back();
      for (const auto& [normal, area] : surfaces) {
        const Vector3d seen = camera.transpose() * turn(noise * normal_(random_), Vector3d::Random()) * normal;
        if (seen.z() > 0.2) continue;
        structure.facings.push_back({.normal = seen.cast<float>(), .area = static_cast<float>(area)});
        structure.area += static_cast<float>(area);
      }
      views.push_back({tilt * camera, nullptr});
    }
    for (std::size_t i = 0; i < views.size(); ++i) views[i].structure = &structures_[i];
  }
  std::vector<StructureView> views;

 private:
  std::deque<Structure> structures_;
  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
};

double angle(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

const std::vector<FlatSurface> kRoom{{kUp, 12}, {kDown, 8}, {kLeft, 8}, {kRight, 8}, {kBack, 10}, {kAhead, 10}};

TEST(VoteGravity, FindsGravityInARoomForAnyFirstCameraPose) {
  for (const double degrees : {0.0, 5.0, 29.0, 60.0, 90.0, 135.0, 180.0})
    for (const Vector3d& axis : {kRight, kAhead, Vector3d(1, 0.3, -0.5)}) {
      const Matrix3d tilt = turn(degrees * kDegree, axis);
      const Walk walk(kRoom, 15 * kDegree, tilt);
      const auto found = vote_gravity(walk.views);
      ASSERT_TRUE(found) << degrees << " about " << axis.transpose();
      EXPECT_LT(angle(found->down, tilt * kDown), kExact) << degrees << " about " << axis.transpose();
      EXPECT_NEAR(found->horizontal + found->vertical, 1, 1e-6);
    }
}

TEST(VoteGravity, FindsNothingInAPlane) {
  const Vector3d oblique = turn(35 * kDegree, kRight) * kBack;
  for (const Vector3d& normal : {oblique, kUp, kDown, kBack})
    EXPECT_FALSE(vote_gravity(Walk({{normal, 10}}, 15 * kDegree).views)) << normal.transpose();
  EXPECT_FALSE(vote_gravity({}));
}

TEST(VoteGravity, FindsNothingInASphere) {
  std::vector<FlatSurface> sphere;
  for (int i = 0; i < 2000; ++i) {  // a Fibonacci lattice
    const double z = 1 - (i + 0.5) / 1000, a = std::numbers::pi * (3 - std::sqrt(5.0)) * i, r = std::sqrt(1 - z * z);
    sphere.push_back({{r * std::cos(a), r * std::sin(a), z}, 0.01});
  }
  EXPECT_FALSE(vote_gravity(Walk(sphere, 15 * kDegree).views));
  EXPECT_FALSE(vote_gravity(Walk(sphere, 15 * kDegree, Matrix3d::Identity(), 0, 30).views));
}

TEST(VoteGravity, WorksWithWallsAloneACeilingOrAFloor) {
  const std::vector<FlatSurface> walls{{kLeft, 8}, {kRight, 8}, {kBack, 10}, {kAhead, 10}};
  std::vector<FlatSurface> ceiling = walls, floor = walls;
  ceiling.push_back({kDown, 20});
  floor.push_back({kUp, 20});
  const Matrix3d tilt = turn(0.4, Vector3d(1, 0, 1));
  for (const auto& surfaces : {walls, ceiling, floor}) {
    const Walk walk(surfaces, 0, tilt);
    const auto found = vote_gravity(walk.views);
    ASSERT_TRUE(found);
    EXPECT_LT(angle(found->down, tilt * kDown), kExact);
  }
}

TEST(VoteGravity, WorksWithATableAndAWallSeenFromAbove) {
  const Walk walk({{kUp, 5}, {kBack, 2}}, 45 * kDegree, Matrix3d::Identity(), 0, 20);
  const auto found = vote_gravity(walk.views);
  ASSERT_TRUE(found);
  EXPECT_LT(angle(found->down, kDown), kExact);
}

TEST(VoteGravity, FindsNothingIfFloorOrCeilingIsAmbiguous) {
  EXPECT_FALSE(vote_gravity(Walk({{kUp, 5}, {kBack, 5}}, 66 * kDegree, Matrix3d::Identity(), 0, 20).views));
}

TEST(VoteGravity, IsRobustToNoiseAndClutter) {
  const Matrix3d tilt = turn(0.5, Vector3d(1, 0.2, 0));
  const Walk noisy(kRoom, 15 * kDegree, tilt, 2.5 * kDegree);
  const auto from_noise = vote_gravity(noisy.views);
  ASSERT_TRUE(from_noise);
  EXPECT_LT(angle(from_noise->down, tilt * kDown), 0.7 * kDegree);  // of about 50 facings, each off by 2.5 degrees

  std::vector<FlatSurface> cluttered = kRoom;  // as much clutter as room
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 560; ++i)
    cluttered.push_back({Vector3d(normal(random), normal(random), normal(random)).normalized(), 0.1});
  const Walk clutter(cluttered, 15 * kDegree, tilt);
  const auto from_clutter = vote_gravity(clutter.views);
  ASSERT_TRUE(from_clutter);
  EXPECT_LT(angle(from_clutter->down, tilt * kDown), 0.3 * kDegree);
}

TEST(VoteGravity, IsRobustToASlopedRoof) {
  // An attic: most of the visible surface is sloped.
  for (const double slope : {30.0, 45.0}) {
    const Vector3d left = turn(slope * kDegree, kAhead) * kDown, right = turn(-slope * kDegree, kAhead) * kDown;
    const Walk walk({{kUp, 10}, {left, 15}, {right, 15}, {kBack, 6}, {kAhead, 6}}, 10 * kDegree);
    const auto found = vote_gravity(walk.views);
    ASSERT_TRUE(found) << slope;
    EXPECT_LT(angle(found->down, kDown), kExact) << slope;
  }
}

TEST(RefineGravity, UsesNearbyFloorsAndWalls) {
  const Walk room(kRoom, 15 * kDegree), floor({{kUp, 10}}, 30 * kDegree);
  for (const Walk* walk : {&room, &floor}) {
    const auto sharper = refine_gravity(walk->views, turn(2 * kDegree, Vector3d(1, 0, 2)) * kDown);
    ASSERT_TRUE(sharper);
    EXPECT_LT(angle(sharper->down, kDown), kExact);
  }
}

TEST(RefineGravity, RejectsAContradictedMeasurement) {
  const Walk room(kRoom, 15 * kDegree), wall({{kBack, 10}}, 0);
  EXPECT_FALSE(refine_gravity(room.views, turn(8 * kDegree, kRight) * kDown));
  EXPECT_FALSE(refine_gravity(wall.views, kDown));  // constrains one direction only
  EXPECT_FALSE(refine_gravity({}, kDown));
}

}  // namespace
}  // namespace cairn
