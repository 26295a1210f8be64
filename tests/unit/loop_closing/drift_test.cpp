// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "loop_closing/drift.hpp"

#include <gtest/gtest.h>

#include <random>

#include "cairn/mapping/pose.hpp"
#include "loop_closing/match.hpp"

namespace cairn {
namespace {

std::vector<Keyframe> wandering(std::size_t count) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> number(-1, 1);
  std::vector<Keyframe> keyframes(count);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (std::size_t k = 0; k < count; ++k) {
    Vector6d step;
    for (double& x : step) x = 0.2 * number(random);
    pose = pose * retract(step);
    keyframes[k].follows = k > 0;
    keyframes[k].odometry_from_camera = pose;
    for (Eigen::Index i = 0; i < 6; ++i) keyframes[k].information(i, i) = std::pow(10.0, 5 + 2 * number(random));
  }
  keyframes[7].information.setZero();  // unknown relative pose
  return keyframes;
}

Matrix6d step_by_step(const std::vector<Keyframe>& keyframes, std::size_t from, std::size_t to) {
  Matrix6d covariance = Matrix6d::Zero();
  for (std::size_t k = from + 1; k <= to; ++k) {
    const Matrix6d ad = adjoint(keyframes[k].odometry_from_camera.inverse() * keyframes[k - 1].odometry_from_camera);
    covariance = Matrix6d(ad * covariance * ad.transpose() + inflate_information(keyframes[k].information).inverse());
  }
  return covariance;
}

TEST(Drift, EqualsTheSumOverAllSteps) {
  const auto keyframes = wandering(1300);
  Drift drift;
  drift.update(keyframes);
  for (const auto& [from, to] : {std::pair<std::size_t, std::size_t>{0, 1},
                                 {0, 8},
                                 {3, 5},
                                 {7, 8},
                                 {5, 29},
                                 {63, 64},
                                 {64, 640},
                                 {1, 1299},
                                 {0, 1299},
                                 {511, 1025},
                                 {20, 20}}) {
    const auto found = drift.covariance(keyframes, from, to);
    ASSERT_TRUE(found);
    const Matrix6d expected = step_by_step(keyframes, from, to);
    EXPECT_LE((*found - expected).norm(), 1e-9 * expected.norm()) << from << " to " << to;
  }
}

TEST(Drift, IsTheSameForIncrementalUpdates) {
  const auto keyframes = wandering(200);
  Drift at_once, one_by_one;
  at_once.update(keyframes);
  for (std::size_t k = 1; k <= keyframes.size(); ++k)
    one_by_one.update({keyframes.begin(), keyframes.begin() + static_cast<std::ptrdiff_t>(k)});
  EXPECT_EQ(at_once.covariance(keyframes, 3, 199), one_by_one.covariance(keyframes, 3, 199));
}

TEST(Drift, IsUnknownBetweenComponents) {
  auto keyframes = wandering(100);
  keyframes[60].follows = false;
  Drift drift;
  drift.update(keyframes);
  EXPECT_TRUE(drift.covariance(keyframes, 0, 59));
  EXPECT_FALSE(drift.covariance(keyframes, 59, 60));
  EXPECT_FALSE(drift.covariance(keyframes, 0, 99));
  EXPECT_TRUE(drift.covariance(keyframes, 60, 99));
}

}  // namespace
}  // namespace cairn
