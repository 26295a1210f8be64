// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>
#include <unistd.h>

#include <clocale>
#include <set>

#include "base/atomic_file.hpp"
#include "base/words.hpp"
#include "cairn/options.hpp"
#include "cairn/trajectory.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

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

TEST(TextFiles, ReadTheSameInAnyLocaleAndFromAnyEditor) {
  const TemporaryFolder folder;
  const auto file = folder / "t.txt";
  // A mark at its begin, lines that end as on Windows, commas, no newline at the end.
  write_text(file,
             "\xef\xbb\xbf"
             "1.5 0.25 0 0 0 0 0 1\r\n2.5, 1e-3, +2, 0, 0, 0, 0, 1");
  const char* german = std::setlocale(LC_ALL, "de_DE.UTF-8");  // where it is installed: a comma is its decimal point
  const auto read = read_trajectory(file);
  if (german != nullptr) std::setlocale(LC_ALL, "C");
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].timestamp, 1.5);
  EXPECT_EQ(read[0].world_from_camera.translation().x(), 0.25);
  EXPECT_EQ(read[1].world_from_camera.translation(), Eigen::Vector3d(1e-3, 2, 0));
}

TEST(TextFiles, ShowWhatIsWrongWithoutWhatATerminalObeys) {
  const TemporaryFolder folder;
  write_text(folder / "t.txt", "0 0 0 0 0 0 0 \x1b[2J\n");
  EXPECT_NE(error_of([&] { (void)read_trajectory(folder / "t.txt"); }).find("'?[2J' is not a number"),
            std::string::npos);
  EXPECT_EQ(shown(std::string(1000, 'a')).size(), 123u);
}

TEST(Trajectory, RefusesAQuaternionThatCannotBeMadeUnit) {
  const TemporaryFolder folder;
  write_text(folder / "t.txt", "0 0 0 0 1e200 0 0 0\n");
  EXPECT_NE(error_of([&] { (void)read_trajectory(folder / "t.txt"); }).find("t.txt:1: the quaternion is zero or too"),
            std::string::npos);
}

TEST(WriteWhole, LeavesTheOldFileWhenWritingFails) {
  const TemporaryFolder folder;
  write_text(folder / "a.txt", "old");
  EXPECT_THROW(write_whole(folder / "a.txt",
                           [](std::ostream& out) {
                             out << "half";
                             throw std::runtime_error("something went wrong");
                           }),
               std::runtime_error);
  EXPECT_EQ(read_bytes(folder / "a.txt"), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(WriteWhole, TellsTheSystemsReasonAndWhatToDo) {
  // /dev/full is a disk without room; whoever writes need not look after it.
  EXPECT_NE(error_of([&] { write_whole("/proc/self/a.txt", "text"); }).find("make the folder first"),
            std::string::npos);
  const TemporaryFolder folder;
  const fs::path link = folder / (".cairn-" + std::to_string(getpid()) + ".a.txt");
  for (const bool as_stream : {false, true}) {
    fs::create_symlink("/dev/full", link);
    const std::string error = error_of([&] {
      if (as_stream)
        write_whole(folder / "a.txt", [](std::ostream& out) { out << std::string(3 << 20, 'x'); });
      else
        write_whole(folder / "a.txt", "text");
    });
    EXPECT_NE(error.find("a.txt: the disk is full (No space left on device): make room"), std::string::npos) << error;
    EXPECT_TRUE(fs::is_empty(folder.path()));
  }
}

TEST(WriteWhole, SeeksInTheStreamAsInAFile) {
  const TemporaryFolder folder;
  const std::string much(3 << 20, 'x');
  write_whole(folder / "a.txt", [&](std::ostream& out) {
    out << much;
    EXPECT_EQ(out.tellp(), std::streampos(3 << 20));
    out.seekp(2) << "ab";
    out.seekp(0, std::ios::end) << "end";
  });
  std::string expected = much + "end";
  expected.replace(2, 2, "ab");
  EXPECT_TRUE(read_bytes(folder / "a.txt") == expected);
}

TEST(WriteWhole, LeftoversOfKilledProgramsGoAndThoseOfRunningOnesStay) {
  const TemporaryFolder folder;
  for (const char* name : {".cairn-4711.a.txt", ".cairn-4711.b.txt", ".cairn-x.txt", ".cairn-", ".hidden", "a.txt"})
    write_text(folder / name, "something");
  // The one of this program, which writes just now.
  write_whole(folder / "b.txt", [&](std::ostream&) {
    remove_leftovers(folder.path());
    EXPECT_TRUE(fs::exists(folder / (".cairn-" + std::to_string(getpid()) + ".b.txt")));
  });
  std::set<std::string> left;
  for (const auto& entry : fs::directory_iterator(folder.path())) left.insert(entry.path().filename().string());
  EXPECT_EQ(left, (std::set<std::string>{".cairn-x.txt", ".cairn-", ".hidden", "a.txt", "b.txt"}));
}

TEST(WriteWhole, NamesTheFolderThatIsMissing) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] { write_whole(folder / "no" / "a.txt", "text"); }).find("cannot write"), std::string::npos);
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

TEST(Options, OfTheDefaultFileAreTheDefaults) {
  const Options defaults;
  Options options{.surface = {.edge_slope = 7},
                  .track = {.max_angle = 0.1f, .photometric = false},
                  .fuse = {.device_memory = 1},
                  .map = {.submap_bricks = 1000, .loops = false},
                  .esdf = {.live = true, .max_distance = 1}};
  read_options(source_folder() / "assets/default.yaml", options);
  EXPECT_EQ(options.surface.edge_slope, defaults.surface.edge_slope);
  EXPECT_EQ(options.track.max_angle, defaults.track.max_angle);
  EXPECT_EQ(options.track.photometric, defaults.track.photometric);
  EXPECT_EQ(options.fuse.device_memory, defaults.fuse.device_memory);
  EXPECT_EQ(options.map.submap_bricks, defaults.map.submap_bricks);
  EXPECT_EQ(options.map.loops, defaults.map.loops);
  EXPECT_EQ(options.esdf.live, defaults.esdf.live);
  EXPECT_EQ(options.esdf.max_distance, defaults.esdf.max_distance);
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
  EXPECT_NE(error("fuse:\n  ? [voxel_size]\n  : 0.02\n").find("o.yaml:2: there is no option"), std::string::npos);
  EXPECT_NE(error(std::string(100000, '[')).find("o.yaml:1: "), std::string::npos);
}

}  // namespace
}  // namespace cairn
