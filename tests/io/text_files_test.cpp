// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include "cairn/options.hpp"
#include "cairn/trajectory.hpp"
#include "io/atomic_file.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

TEST(Trajectory, ComesBackAsItWasWritten) {
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

TEST(Trajectory, RefusesBadLinesByNumber) {
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

TEST(WriteWhole, LeavesTheOldFileWhenWritingFails) {
  const TemporaryFolder folder;
  write_text(folder / "a.txt", "old");
  EXPECT_THROW(write_whole(folder / "a.txt",
                           [](const std::filesystem::path& temporary) {
                             write_text(temporary, "half");
                             throw std::runtime_error("the disk is full");
                           }),
               std::runtime_error);
  EXPECT_EQ(read_bytes(folder / "a.txt"), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(WriteWhole, NamesTheFolderThatIsMissing) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] { write_whole(folder / "no" / "a.txt", [](const auto&) {}); }).find("cannot write"),
            std::string::npos);
}

TEST(Options, AreOverriddenByYaml) {
  const TemporaryFolder folder;
  write_text(folder / "o.yaml", "fuse:\n  voxel_size: 0.02\n  truncation: 0.08\ntrack:\n  levels: 4\n");
  Options options;
  read_options(folder / "o.yaml", options);
  EXPECT_FLOAT_EQ(options.fuse.voxel_size, 0.02f);
  EXPECT_EQ(options.track.levels, 4);
  EXPECT_FLOAT_EQ(options.surface.max_depth, Options{}.surface.max_depth);
}

TEST(Options, RefuseUnknownKeysAndBadValuesByLine) {
  const TemporaryFolder folder;
  const auto file = folder / "o.yaml";
  const auto error = [&](const std::string& text) {
    write_text(file, text);
    Options options;
    return error_of([&] { read_options(file, options); });
  };
  EXPECT_NE(error("fuse:\n  voxel_sise: 0.02\n").find("o.yaml:2: there is no option `fuse.voxel_sise`"),
            std::string::npos);
  EXPECT_NE(error("fuse:\n  voxel_size: big\n").find("o.yaml:2"), std::string::npos);
  EXPECT_NE(error("fuse: 3\n").find("o.yaml:1"), std::string::npos);
  EXPECT_NE(error("fuse:\n  voxel_size: -1\n").find("voxel_size"), std::string::npos);
  EXPECT_NE(error("fuse: [\n").find("o.yaml:"), std::string::npos);
}

}  // namespace
}  // namespace cairn
