// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/trajectory.hpp"

#include <gtest/gtest.h>

#include "support/files.hpp"

namespace cairn {
namespace {

TEST(Trajectory, RoundTrips) {
  const TemporaryFolder folder;
  Trajectory written;
  for (int i = 0; i < 5; ++i) {
    Eigen::Isometry3d pose(Eigen::AngleAxisd(0.7 * i, Eigen::Vector3d(1, 2, 3).normalized()));
    pose.translation() = Eigen::Vector3d(i, -2.5 * i, 0.1);
    written.push_back({1305031102.1758 + i, pose});
  }
  write_trajectory(folder / "t.txt", written);
  const auto read = read_trajectory(folder / "t.txt");
  ASSERT_EQ(read.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(read[i].timestamp, written[i].timestamp, 1e-6);
    EXPECT_TRUE(read[i].world_from_camera.isApprox(written[i].world_from_camera, 1e-7));
  }
}

TEST(Trajectory, RejectsBadLinesWithNumber) {
  const TemporaryFolder folder;
  const auto file = folder / "t.txt";
  for (const char* bad :
       {"1 0 0 0 0 0 0", "1 0 0 nan 0 0 0 1", "1 0 0 0 0 0 0 0", "1 0 0 0 0 0 0 x", "1 0 0 0 0 0 0 1 9"}) {
    write_text(file, std::string("# comment\n0 0 0 0 0 0 0 1\n") + bad + "\n");
    EXPECT_NE(error_of([&] { (void)read_trajectory(file); }).find("t.txt:3"), std::string::npos) << bad;
  }
  write_text(file, "# nothing\n");
  EXPECT_NE(error_of([&] { (void)read_trajectory(file); }).find("no pose"), std::string::npos);
}

TEST(Trajectory, RejectsQuaternionWithoutNorm) {
  const TemporaryFolder folder;
  write_text(folder / "t.txt", "0 0 0 0 1e200 0 0 0\n");
  EXPECT_NE(error_of([&] { (void)read_trajectory(folder / "t.txt"); }).find("t.txt:1: the quaternion is zero or too"),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
