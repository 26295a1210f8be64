// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Evaluation of a map with held-out frames.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class JudgedMap : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    write_small_recording(*folder / "room");
  }
  static void TearDownTestSuite() { delete folder; }
  static std::string in(const std::string& name) { return (*folder / name).string(); }
  static Ran reconstruct(const std::string& map, std::vector<std::string> more) {
    std::vector<std::string> words{"reconstruct", in("room"), "-o", in(map), "--config", in("room.yaml"), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run_cairn(words);
  }
  static nlohmann::json json_of(const Ran& ran) {
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.exit_code == 0 ? nlohmann::json::parse(ran.out) : nlohmann::json{};
  }
  static inline TemporaryFolder* folder = nullptr;
};

TEST_F(JudgedMap, IsJudgedByFramesThatItHasNeverSeen) {
  const auto report = json_of(reconstruct("map", {"--hold-out", "5", "--reintegrate"}));
  EXPECT_EQ(report["frames"]["total"], 40);
  EXPECT_EQ(report["frames"]["fused"], 32);
  EXPECT_EQ(report["frames"]["held_out"], 8);
  EXPECT_EQ(report["verdict"]["words"].get<std::string>().find("32 of 32 frames are in the map, 8 were held out"), 0u);
  EXPECT_EQ(read_trajectory(*folder / "map" / "trajectory.txt").size(), 40u);
  const auto judged = json_of(run_cairn({"evaluate", "map", in("map"), in("room"), "--json"}));
  EXPECT_EQ(judged["frames"], 8);
  EXPECT_EQ(judged["held_out"], true);
  EXPECT_LT(judged["depth"][0]["error_m"]["rmse"], 0.02);
  const Ran told = run_cairn({"evaluate", "map", in("map"), in("room"), "--step", "2"});
  EXPECT_NE(told.out.find("4, all held out from the map"), std::string::npos) << told.out;
}

TEST_F(JudgedMap, IsOtherwiseJudgedByFramesBetweenKeyframes) {
  json_of(reconstruct("whole", {"--no-texture"}));
  const auto judged = json_of(run_cairn({"evaluate", "map", in("whole"), in("room"), "--step", "1", "--json"}));
  EXPECT_EQ(judged["held_out"], false);
  EXPECT_GT(judged["frames"], 8);
}

TEST_F(JudgedMap, GoesOnAsItsSessionBegan) {
  json_of(reconstruct("half", {"--no-texture", "--hold-out", "5", "--frames", "18"}));
  const Ran other = reconstruct("half", {"--no-texture", "--hold-out", "4", "--resume"});
  expect_one_line(other, 1,
                  "was started with --hold-out 5; resume without the option, or start again with --overwrite");
  const auto report = json_of(reconstruct("half", {"--no-texture", "--resume"}));
  EXPECT_EQ(report["frames"]["held_out"], 8);
  json_of(reconstruct("at-once", {"--no-texture", "--hold-out", "5"}));
  for (const char* file : {"mesh.glb", "trajectory.txt"})
    EXPECT_TRUE(read_bytes(*folder / "half" / file) == read_bytes(*folder / "at-once" / file)) << file;
  json_of(reconstruct("none", {"--no-texture", "--frames", "10"}));
  expect_one_line(reconstruct("none", {"--no-texture", "--hold-out", "4", "--resume"}), 1,
                  "was started with no held-out frames");
}

TEST_F(JudgedMap, TellsWhatIsWrongWithItsNumber) {
  for (const char* number : {"0", "1", "-3", "often"}) {
    const Ran ran = reconstruct("wrong", {std::string("--hold-out=") + number});
    expect_one_line(ran, 2, "whole number expected, 2 to");
    EXPECT_FALSE(fs::exists(*folder / "wrong"));
  }
  const auto report = json_of(reconstruct("few", {"--no-texture", "--hold-out", "20", "--frames", "12"}));
  EXPECT_FALSE(report.contains("hold_out"));
  EXPECT_NE(report["warnings"].dump().find("no frame was held out: give a smaller number"), std::string::npos);
}

}  // namespace
}  // namespace cairn
