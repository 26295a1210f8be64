// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/pose_convention.hpp"

#include <gtest/gtest.h>

#include "support/files.hpp"

namespace cairn {
namespace {

Eigen::Isometry3d some_pose(double t) {
  Eigen::Isometry3d pose(Eigen::AngleAxisd(0.4 + t, Eigen::Vector3d(1, 2, -1).normalized()));
  pose.translation() = Eigen::Vector3d(1 + t, -2, 0.5 * t);
  return pose;
}

Eigen::Isometry3d read_as(const std::string& convention, const Eigen::Isometry3d& pose) {
  return with_convention({{0, pose}}, pose_convention(convention)).at(0).world_from_camera;
}

TEST(PoseConvention, RoundTripsAsText) {
  EXPECT_EQ(pose_convention(""), PoseConvention{});
  EXPECT_EQ(to_string(PoseConvention{}), "");
  for (const char* text :
       {"camera_from_world", "wxyz", "opengl", "ros", "unity", "axes=-y,x,z", "axes=z,y,x", "mm", "cm", "ft", "km",
        "scale=0.25", "clock=-0.5", "wxyz,camera_from_world,axes=z,-x,y,mm,clock=+1.5"})
    EXPECT_EQ(to_string(pose_convention(text)), text);
  EXPECT_EQ(to_string(pose_convention("axes=x,-y,-z")), "opengl");
  EXPECT_EQ(to_string(pose_convention("scale=0.001,wxyz")), "wxyz,mm");
}

TEST(PoseConvention, RejectsUnknownText) {
  for (const auto& [text, why] : {std::pair{"opencv", "'opencv' is unknown"},
                                  {"wxyz,,mm", "'' is unknown"},
                                  {"axes=x,y", "three directions"},
                                  {"axes=x,y,y", "once each"},
                                  {"axes=x,y,w", "once each"},
                                  {"scale=0", "more than 0"},
                                  {"scale=nan", "not a number"},
                                  {"clock=1s", "not a number"},
                                  {"mm,cm", "twice"},
                                  {"opengl,axes=x,y,z", "twice"},
                                  {"wxyz,wxyz", "twice"}}) {
    const std::string error = error_of([&] { (void)pose_convention(text); });
    EXPECT_NE(error.find(why), std::string::npos) << text << ": " << error;
    EXPECT_EQ(error.find('\n'), std::string::npos);
  }
}

TEST(PoseConvention, ConvertsPoses) {
  const Eigen::Isometry3d truth = some_pose(0);
  EXPECT_TRUE(read_as("camera_from_world", truth.inverse()).isApprox(truth, 1e-12));
  // OpenGL's camera looks along -z with y up.
  Eigen::Isometry3d gl = truth;
  gl.linear() = truth.linear() * Eigen::DiagonalMatrix<double, 3>(1, -1, -1);
  EXPECT_TRUE(read_as("opengl", gl).isApprox(truth, 1e-12));
  EXPECT_TRUE(read_as("camera_from_world,opengl", gl.inverse()).isApprox(truth, 1e-12));
  // ROS' body frame has x forward and z up.
  const Eigen::Isometry3d read = read_as("ros", truth);
  EXPECT_TRUE((read.linear() * Eigen::Vector3d::UnitZ()).isApprox(truth.linear() * Eigen::Vector3d::UnitX(), 1e-12));
  EXPECT_TRUE((read.linear() * Eigen::Vector3d::UnitY()).isApprox(truth.linear() * -Eigen::Vector3d::UnitZ(), 1e-12));
  Eigen::Isometry3d mm = truth;
  mm.translation() *= 1000;
  EXPECT_TRUE(read_as("mm", mm).isApprox(truth, 1e-12));
  EXPECT_EQ(with_convention({{3, truth}}, pose_convention("clock=-0.5")).at(0).timestamp, 2.5);
}

TEST(PoseConvention, ReadsQuaternionsWithScalarFirst) {
  const TemporaryFolder folder;
  const Eigen::Isometry3d truth = some_pose(1);
  const Eigen::Quaterniond q(truth.linear());
  std::string line = "0";
  for (const double v :
       {truth.translation().x(), truth.translation().y(), truth.translation().z(), q.w(), q.x(), q.y(), q.z()})
    line += ' ' + std::to_string(v);
  write_text(folder / "poses.txt", line + "\n");
  EXPECT_TRUE(read_as("wxyz", read_trajectory(folder / "poses.txt").at(0).world_from_camera).isApprox(truth, 1e-5));
}

TEST(PoseConvention, MirrorsLeftHandedWorld) {
  const PoseConvention unity = pose_convention("unity");
  const Eigen::Matrix3d flip = unity.axes;
  ASSERT_LT(flip.determinant(), 0);
  // Unity's convention: y up in both the world and the camera.
  Eigen::Isometry3d mirrored = Eigen::Isometry3d::Identity();
  const Eigen::Isometry3d truth = some_pose(0.3);
  mirrored.linear() = flip * truth.linear() * flip;
  mirrored.translation() = flip * truth.translation();
  EXPECT_TRUE(read_as("unity", mirrored).isApprox(truth, 1e-12));
}

}  // namespace
}  // namespace cairn
