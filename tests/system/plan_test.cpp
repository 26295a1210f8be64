// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings of a building as segments, with the program.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "cairn/mapping/trajectory.hpp"
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
  EXPECT_EQ(ran.out, fs::canonical(in("walk")).string() + ": 40 frames, segments 000 to 001\n" + in("plan") +
                         ": 2 segments, of at most 23 frames\nnext: cairn reconstruct " + in("plan/parts/000") +
                         " -o " + in("plan/maps/000") + " --no-mesh --reintegrate  (the first of 2 segments)\n");
  // Omitted options are taken from the plan.
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

/// Expects all phrases in a text.
void expect_in(const std::string& text, const std::vector<std::string>& all) {
  for (const std::string& one : all) EXPECT_NE(text.find(one), std::string::npos) << one << " in:\n" << text;
}

TEST_F(PlannedBuilding, IsReportedOnWithTheNextCommand) {
  ASSERT_EQ(plan({in("walk"), "--frames-per-part", "20", "--overlap", "5"}).exit_code, 0);
  const auto info = [&] {
    const Ran ran = run_cairn({"info", in("plan")});
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.out;
  };
  expect_in(info(), {"1 recordings, 40 frames, 2 segments", "segment 001", "frames 17 to 39: has no map yet",
                     "maps            0 made, 0 failed, 2 missing", "next: cairn reconstruct"});
  for (const char* part : {"000", "001"}) {
    fs::create_directories(in("plan/maps/") + part + "/session");
    write_text(in("plan/maps/") + part + "/session/state.cbor", "");
  }
  expect_in(info(), {"maps            2 made, 0 failed, 0 missing", "pairs           0 matched, 1 missing",
                     "next: cairn match " + in("plan/maps/000") + " " + in("plan/maps/001")});
  fs::create_directories(in("plan/loops"));
  write_text(in("plan/loops/000-001.json"), "{}");
  expect_in(info(), {"next: cairn optimize " + in("plan")});
  write_text(in("plan/report.json"),
             R"({"parts": [{"name": "000", "recording": 0, "joined": true},
                           {"name": "001", "recording": 0, "joined": false, "left_out": "no loop closure connects it to the others"}]})");
  fs::create_directories(in("plan/cells"));
  write_text(in("plan/cells/0,0,-1.json"), "{}");
  expect_in(info(),
            {"segment 000", "is in the map", "is left out: no loop closure connects it to the others",
             "cells           1, 0 made, 1 missing", "BAD: 1 of 2 parts are in the map, with 48 % of the frames",
             "record the space between it and the other parts", "next: cairn tile " + in("plan") + " --cell=0,0,-1"});
  const Ran json = run_cairn({"info", in("plan"), "--json"});
  const auto told = nlohmann::json::parse(json.out);
  EXPECT_EQ(told.at("verdict").at("level"), "bad");
  EXPECT_EQ(told.at("cells"), (nlohmann::json{{"count", 1}, {"made", 0}}));
  write_text(in("plan/report.json"), "{");
  expect_one_line(run_cairn({"info", in("plan")}), 1, "make it again with cairn optimize");
}

TEST_F(PlannedBuilding, HasPiecesThatAreNamed) {
  ASSERT_EQ(plan({in("walk")}).exit_code, 0);
  for (const char* piece : {"cells/0,0,0.json", "loops/000-001.json", "tiles/0,0,0/tileset.json", "maps/000/x"}) {
    fs::create_directories(fs::path(in(std::string("plan/") + piece)).parent_path());
    write_text(in(std::string("plan/") + piece), "{}");
  }
  const auto told = [&](const std::string& piece, const std::string& words) {
    expect_one_line(run_cairn({"info", in("plan/" + piece)}), 1, words);
  };
  told("cells", "is the folder of a project's cells; cairn info");
  told("cells/0,0,0.json", "is a cell of a project");
  told("loops", "is the folder of a project's matches");
  told("loops/000-001.json", "contains matches between two maps of a project; cairn optimize");
  told("tiles", "is the folder of a project's tiles; cairn view");
  told("tiles/0,0,0", "is a cell of a project's map");
  told("maps", "is the folder of a project's maps");
  told("parts", "is the folder of a project's parts");
  told("plan.json", "is an internal file of a project");
  EXPECT_EQ(run_cairn({"info", in("plan/parts/000")}).exit_code, 0);  // a recording
  expect_one_line(run_cairn({"match", in("plan"), in("plan"), "-o", in("x.json")}), 1,
                  "is a plan whose maps are not merged yet");
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
