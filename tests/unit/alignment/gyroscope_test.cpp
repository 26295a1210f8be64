// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "alignment/gyroscope.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn {
namespace {

/// Orientation of a camera that rotates about all axes.
Eigen::Quaterniond world_from_camera(double t) {
  return Eigen::AngleAxisd(0.8 * std::sin(1.3 * t), Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(1.1 * std::sin(0.9 * t), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(0.6 * std::sin(1.7 * t), Eigen::Vector3d::UnitZ());
}

Eigen::Vector3d rate(double t) {
  constexpr double kStep = 1e-4;
  const Eigen::AngleAxisd turn(world_from_camera(t - kStep).conjugate() * world_from_camera(t + kStep));
  return turn.angle() / (2 * kStep) * turn.axis();
}

std::vector<AngularRate> samples(double since, double until, const Eigen::Quaterniond& imu_from_camera,
                                 const Eigen::Vector3d& bias) {
  std::vector<AngularRate> rates;
  for (double t = since; t <= until; t += 0.005) rates.push_back({t, imu_from_camera * rate(t) + bias});
  return rates;
}

double degrees_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b) * 57.29578;
}

/// Calibrates with ten seconds of frames.
void teach(Gyroscope& gyroscope) {
  for (int i = 1; i < 300; ++i) {
    const double since = (i - 1) / 30.0, until = i / 30.0;
    gyroscope.learn(since, until, world_from_camera(since).conjugate() * world_from_camera(until));
  }
}

TEST(Gyroscope, IntegratesRatesBetweenAnyTimes) {
  Gyroscope gyroscope(Eigen::Quaterniond::Identity());
  gyroscope.add(samples(0, 3, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()));
  for (const double since : {0.0, 0.313, 1.2}) {
    const auto turn = gyroscope.rotation(since, since + 1.4037);
    ASSERT_TRUE(turn);
    EXPECT_LT(degrees_between(*turn, world_from_camera(since).conjugate() * world_from_camera(since + 1.4037)), 0.02);
  }
  EXPECT_LT((*gyroscope.rate(1.5) - rate(1.5)).norm(), 0.01);
}

TEST(Gyroscope, ReturnsNothingWhereSamplesAreMissing) {
  Gyroscope gyroscope(Eigen::Quaterniond::Identity());
  EXPECT_FALSE(gyroscope.rotation(0, 1));
  gyroscope.add(samples(0, 1, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()));
  gyroscope.add(samples(2, 3, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()));
  EXPECT_TRUE(gyroscope.rotation(0.1, 0.9));
  EXPECT_FALSE(gyroscope.rotation(0.5, 2.5));
  EXPECT_FALSE(gyroscope.rotation(2.5, 3.5));
  EXPECT_FALSE(gyroscope.rotation(0.5, 0.5));
  gyroscope.forget_before(2.5);
  EXPECT_FALSE(gyroscope.rotation(0.1, 0.9));
  EXPECT_TRUE(gyroscope.rotation(2.5, 2.9));
}

TEST(Gyroscope, EstimatesBiasFromAlignedRotations) {
  const Eigen::Vector3d bias(0.01, -0.02, 0.015);
  Gyroscope gyroscope(Eigen::Quaterniond::Identity());
  gyroscope.add(samples(0, 10.1, Eigen::Quaterniond::Identity(), bias));
  EXPECT_EQ(gyroscope.bias(), Eigen::Vector3d::Zero());
  teach(gyroscope);
  EXPECT_LT((gyroscope.bias() - bias).norm(), 2e-4);
}

TEST(Gyroscope, EstimatesAnUnknownOrientation) {
  const Eigen::Quaterniond imu_from_camera(Eigen::AngleAxisd(2.1, Eigen::Vector3d(1, -2, 0.5).normalized()));
  const Eigen::Vector3d bias(0.01, -0.02, 0.015);
  Gyroscope gyroscope(std::nullopt);
  gyroscope.add(samples(0, 10.1, imu_from_camera, bias));
  EXPECT_FALSE(gyroscope.rotation(1, 2));
  teach(gyroscope);
  ASSERT_TRUE(gyroscope.camera_from_imu());
  EXPECT_LT(degrees_between(*gyroscope.camera_from_imu(), imu_from_camera.conjugate()), 0.1);
  EXPECT_LT((gyroscope.bias() - bias).norm(), 1e-3);
  EXPECT_LT(degrees_between(*gyroscope.rotation(1, 2), world_from_camera(1).conjugate() * world_from_camera(2)), 0.2);
}

TEST(Gyroscope, NeedsRotationsAboutTwoAxesForItsOrientation) {
  Gyroscope gyroscope(std::nullopt);
  std::vector<AngularRate> rates;
  for (double t = 0; t < 4; t += 0.005) rates.push_back({t, Eigen::Vector3d(0, std::cos(t), 0)});
  gyroscope.add(rates);
  for (int i = 1; i < 100; ++i) {
    const double since = (i - 1) / 30.0, until = i / 30.0;
    gyroscope.learn(since, until,
                    Eigen::Quaterniond(Eigen::AngleAxisd(std::sin(until) - std::sin(since), Eigen::Vector3d::UnitY())));
  }
  EXPECT_FALSE(gyroscope.camera_from_imu());
}

}  // namespace
}  // namespace cairn
