// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A second recording in the map of the first, with the program.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Map of a recording, made once, and other recordings.
class Localize : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    write_small_recording(*folder / "monday", {.frames = 30, .speed = 3});
    write_small_recording(*folder / "tuesday", {.frames = 12, .speed = 2});
    write_small_recording(*folder / "elsewhere", {.frames = 6, .scene = "flat"});
    const Ran ran = run({"reconstruct", "monday", "-o", "map", "--no-mesh", "--config", "monday.yaml"});
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
  }
  static void TearDownTestSuite() {
    delete folder;
    folder = nullptr;
  }
  static Ran run(const std::vector<std::string>& arguments) {
    return run_cairn(arguments, "cd '" + folder->path().string() + "';");
  }
  static Ran localize(const std::string& recording, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"localize", "map", recording, "--config", "monday.yaml"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  static inline TemporaryFolder* folder = nullptr;
};

TEST_F(Localize, WritesPosesAndCovariancesAndLeavesTheMapUnchanged) {
  const auto before = bytes_below(*folder / "map");
  const Ran ran = localize("tuesday", {"-o", "poses.txt", "--covariances", "covariances.csv", "--json"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  const Json json = Json::parse(ran.out);
  EXPECT_EQ(json.at("frames"), 12);
  EXPECT_GE(json.at("localized"), 11);
  EXPECT_GT(json.at("first_pose_s"), 0.0);
  EXPECT_GT(json.at("rate_hz"), 0.0);
  const Trajectory poses = read_trajectory(*folder / "poses.txt"),
                   map = read_trajectory(*folder / "map/trajectory.txt");
  EXPECT_EQ(poses.size(), json.at("localized").get<std::size_t>());
  for (const StampedPose& pose : poses) {  // the second recording has two thirds of the speed
    const auto expected = pose_at(map, pose.timestamp * 2 / 3);
    ASSERT_TRUE(expected.has_value());
    EXPECT_LT((expected->inverse() * pose.world_from_camera).translation().norm(), 0.03) << pose.timestamp;
  }
  const std::string lines = read_bytes(*folder / "covariances.csv");
  EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), static_cast<long>(poses.size()) + 1);
  EXPECT_EQ(bytes_below(*folder / "map"), before);
}

TEST_F(Localize, PrintsPosesAtOnce) {
  const Ran ran = localize("tuesday", {"-o", "-", "--frames", "4"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(std::count(ran.out.begin(), ran.out.end(), '\n'), 4) << ran.out;
}

TEST_F(Localize, PrintsTheShareAndTheRate) {
  const Ran ran = localize("tuesday", {"-o", "again.txt"});
  EXPECT_NE(ran.out.find("of 12 frames localized ("), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("frames/s"), std::string::npos) << ran.out;
}

TEST_F(Localize, OfAnotherPlaceEndsWithItsExitCodeAndWithoutAFile) {
  const Ran ran = localize("elsewhere", {"-o", "none.txt"});
  EXPECT_EQ(ran.exit_code, 3) << ran.err;
  EXPECT_NE(ran.out.find("0 of 6 frames localized"), std::string::npos) << ran.out;
  EXPECT_FALSE(fs::exists(*folder / "none.txt"));
}

TEST_F(Localize, AnswersBadInputWithOneLine) {
  expect_one_line(run({"localize", "monday", "tuesday", "-o", "x.txt"}), 1, "is a recording, not a map with a session");
  expect_one_line(localize("tuesday", {"-o", "map/session/state.cbor"}), 1, "session");
  expect_one_line(localize("tuesday", {"-o", "map"}), 1, "is the input map");
  expect_one_line(localize("tuesday", {"-o", "-", "--json"}), 2, "both print to stdout");
  fs::create_directories(*folder / "empty");
  expect_one_line(localize("empty", {"-o", "x.txt"}), 1, "empty");
  expect_one_line(localize("tuesday", {"-o", "x.txt", "--mask", "empty"}), 1, "contains no mask");
  EXPECT_FALSE(fs::exists(*folder / "x.txt"));
}

}  // namespace
}  // namespace cairn
