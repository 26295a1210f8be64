// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A building's recordings as parts, by the program.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/source.hpp"
#include "cairn/trajectory.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class PlannedBuilding : public testing::Test {
 protected:
  void SetUp() override { write_small_recording(folder / "walk"); }
  [[nodiscard]] std::string in(const std::string& name) const { return (folder / name).string(); }
  [[nodiscard]] Ran plan(const std::vector<std::string>& more) const {
    std::vector<std::string> words{"plan", "-o", in("plan")};
    words.insert(words.end(), more.begin(), more.end());
    return run_cairn(words);
  }
  TemporaryFolder folder;
};

TEST_F(PlannedBuilding, IsToldByRecordingAndNumberOfParts) {
  const Ran ran = plan({in("walk"), "--frames-per-part", "20", "--overlap", "5"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(ran.out, fs::canonical(in("walk")).string() + ": 40 frames, parts 000 to 001\n" + in("plan") +
                         ": 2 parts, of 23 frames at most\n");
  // What is not asked for again is the plan's.
  const Ran again = plan({in("walk"), "--json"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  const auto json = nlohmann::json::parse(again.out);
  EXPECT_EQ(json.at("plan"), in("plan"));
  EXPECT_EQ(json.at("recordings").at(0).at("frames"), 40);
  EXPECT_EQ(json.at("parts").at(1),
            (nlohmann::json{
                {"name", "001"}, {"folder", in("plan/parts/001")}, {"recording", 0}, {"begin", 17}, {"end", 40}}));
  expect_one_line(plan({in("walk"), "--overlap", "6"}), 1, "was made with --frames-per-part 20 and --overlap 5");
  expect_one_line(plan({in("walk"), "--overlap", "20"}), 1, "--overlap is 20: take 0 or more, and less than");
}

TEST_F(PlannedBuilding, HasPartsThatGoOnWhereTheirRunWasCutOff) {
  ASSERT_EQ(plan({in("walk"), "--frames-per-part", "20", "--overlap", "5"}).exit_code, 0);
  const auto reconstruct = [&](const std::string& map, std::vector<std::string> more) {
    std::vector<std::string> words{"reconstruct", in("plan/parts/001"), "-o",           in(map),
                                   "--config",    in("walk.yaml"),      "--no-texture", "--json"};
    words.insert(words.end(), more.begin(), more.end());
    const Ran ran = run_cairn(words);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.exit_code == 0 ? nlohmann::json::parse(ran.out) : nlohmann::json{};
  };
  EXPECT_EQ(reconstruct("half", {"--frames", "10", "--hold-out", "5"}).at("frames").at("total"), 10);
  const auto whole = reconstruct("half", {"--resume"});
  EXPECT_EQ(whole.at("frames").at("total"), 23);
  const auto at_once = reconstruct("at-once", {"--hold-out", "5"});
  EXPECT_EQ(whole.at("frames").at("held_out"), 4);
  EXPECT_EQ(at_once.at("frames").at("held_out"), 4);
  const auto first = open_source(in("walk"), {.range = {.begin = 17}})->next_timestamp();
  constexpr double kHalfAFrame = 0.5 / 30;  // seconds; the map corrects the clock of depth
  EXPECT_NEAR(read_trajectory(in("half/trajectory.txt")).front().timestamp, first.value_or(-1), kHalfAFrame);
  for (const char* file : {"/mesh.glb", "/trajectory.txt"})
    EXPECT_TRUE(read_bytes(in("half") + file) == read_bytes(in("at-once") + file)) << file;
}

}  // namespace
}  // namespace cairn
