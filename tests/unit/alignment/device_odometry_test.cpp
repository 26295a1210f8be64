// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "alignment/device_odometry.hpp"

#include <gtest/gtest.h>

namespace cairn {
namespace {

constexpr PoseSigma kCommonError{.rotation = 0.0002, .translation = 0.0003};

Eigen::Isometry3d translation(double x, double y, double z) { return Eigen::Isometry3d(Eigen::Translation3d(x, y, z)); }

/// Alignment at `pose` with `count` points in each direction of the pose.
Alignment alignment_at(const Eigen::Isometry3d& pose, double count) {
  return {.submap_from_camera = pose, .information = 1e4 * count * Matrix6d::Identity()};
}

/// Path at 0.3 m/s and 20 degrees/s, 30 Hz; `device_at` distorts the true pose.
template <class DeviceAt>
DeviceOdometry after_path(const DeviceAt& device_at, int frames = 300) {
  DeviceOdometry odometry;
  for (int i = 0; i < frames; ++i) {
    const Eigen::Isometry3d pose =
        translation(0.01 * i, 0, 0) * Eigen::AngleAxisd(0.0116 * i, Eigen::Vector3d::UnitY());
    odometry.add(i / 30.0, device_at(i, pose), {pose, kCommonError});
  }
  return odometry;
}

TEST(DeviceOdometry, StartsWithATypicalDrift) {
  EXPECT_FALSE(DeviceOdometry().is_known());
  EXPECT_GT(DeviceOdometry().drift()->translation, 0.01);
}

TEST(DeviceOdometry, EstimatesTheDriftOfAWrongScale) {
  const DeviceOdometry odometry = after_path([](int, Eigen::Isometry3d pose) {
    pose.translation() *= 1.05;
    return pose;
  });
  ASSERT_TRUE(odometry.is_known());
  EXPECT_NEAR(odometry.drift()->translation, 0.05, 0.01);
  EXPECT_NEAR(odometry.drift()->rotation, 0.01, 1e-6);
}

TEST(DeviceOdometry, IgnoresTheWorldOfTheDevice) {
  const Eigen::Isometry3d world = translation(5, -2, 1) * Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, 3).normalized());
  const DeviceOdometry odometry = after_path([&](int, const Eigen::Isometry3d& pose) { return world * pose; });
  EXPECT_NEAR(odometry.drift()->translation, 0.01, 1e-6);
}

TEST(DeviceOdometry, KeepsADeviceWithFewJumps) {
  const DeviceOdometry odometry =
      after_path([](int i, const Eigen::Isometry3d& pose) { return translation(0, 0.3 * (i / 100), 0) * pose; });
  EXPECT_NEAR(odometry.drift()->translation, 0.01, 1e-6);
}

TEST(DeviceOdometry, DropsAnotherPath) {
  const auto other = [](int i, const Eigen::Isometry3d&) { return translation(0, 0, -0.01 * i); };
  EXPECT_FALSE(after_path(other).drift());
}

TEST(DeviceOdometry, DropsADeviceThatContradictsLong) {
  DeviceOdometry odometry = after_path([](int, const Eigen::Isometry3d& pose) { return pose; });
  ASSERT_TRUE(odometry.drift());
  for (int i = 0; i < 40; ++i)
    odometry.add(20 + i / 30.0, Eigen::Isometry3d::Identity(), {Eigen::Isometry3d::Identity(), kCommonError, true});
  EXPECT_FALSE(odometry.drift());
}

TEST(DeviceOdometry, AlignmentErrorIsNoDrift) {
  constexpr PoseSigma kPhone{.rotation = 0.007, .translation = 0.014};
  DeviceOdometry odometry;
  for (int i = 0; i < 600; ++i) {
    const Eigen::Isometry3d pose = translation(0.005 * i, 0, 0), off = translation(0, i % 2 ? 0.0095 : -0.0095, 0);
    odometry.add(i / 60.0, pose, {pose * off, kPhone});
  }
  EXPECT_LT(odometry.drift()->translation, 0.06);
}

TEST(FuseDevicePose, SurfaceHoldsObservedDirections) {
  Alignment a = alignment_at(Eigen::Isometry3d::Identity(), 1e7);
  const Matrix6d device = device_covariance({0.03, 0.03}, translation(0.01, 0, 0));
  ASSERT_TRUE(fuse_device_pose(translation(0.0005, 0, 0), device, {0, 1e-6}, a));
  EXPECT_LT(a.submap_from_camera.translation().x(), 0.0001);
}

TEST(FuseDevicePose, DeviceHoldsUnobservedDirections) {
  Alignment a = alignment_at(Eigen::Isometry3d::Identity(), 1e5);
  a.information.row(3).setZero(), a.information.col(3).setZero();
  const Matrix6d device = device_covariance({0.03, 0.03}, translation(0.01, 0, 0));
  ASSERT_TRUE(fuse_device_pose(translation(0.02, 0, 0), device, {0, 1e-6}, a));
  EXPECT_NEAR(a.submap_from_camera.translation().x(), 0.02, 1e-4);
}

TEST(FuseDevicePose, RejectsAContradiction) {
  Alignment a = alignment_at(Eigen::Isometry3d::Identity(), 1e5);
  const Matrix6d device = device_covariance({0.01, 0.01}, translation(0.01, 0, 0));
  EXPECT_FALSE(fuse_device_pose(translation(0, 0.05, 0), device, kCommonError, a));
  EXPECT_TRUE(a.submap_from_camera.isApprox(Eigen::Isometry3d::Identity()));
}

}  // namespace
}  // namespace cairn
