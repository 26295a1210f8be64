// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// `cairn live` without a browser; with a browser: tests/system/browser.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "net/server.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"
#include "support/running.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class Live : public testing::Test {
 protected:
  [[nodiscard]] std::string out(const std::string& name) const { return (folder / name).string(); }
  void expect_map(const std::string& name) const {
    for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt", "report.json", "report.html"})
      EXPECT_TRUE(fs::exists(folder / name / file)) << file;
  }
  [[nodiscard]] nlohmann::json report(const std::string& name) const {
    return nlohmann::json::parse(read_bytes(folder / name / "report.json"));
  }
  TemporaryFolder folder;
};

TEST_F(Live, MapsASensorUntilItIsUnplugged) {
  const auto room = open_synthetic({.scene = "room", .first = 0, .frames = 90});
  for (int i = 0; auto frame = room->next(); ++i) {
    std::ofstream depth(folder / ("depth-" + std::to_string(i) + ".raw"), std::ios::binary);
    std::ofstream color(folder / ("color-" + std::to_string(i) + ".raw"), std::ios::binary);
    for (std::size_t p = 0; p < frame->depth.size(); ++p) {
      const auto z = static_cast<std::uint16_t>(std::lround(1000 * frame->depth[p]));
      depth.write(reinterpret_cast<const char*>(&z), 2);
      color.write(reinterpret_cast<const char*>(&frame->color[p]), 3);
    }
  }
  const Ran ran = run_cairn({"live", "--no-texture", "--voxel-size", "0.03", "openni:", "-o", out("map")},
                            "LD_LIBRARY_PATH='" + openni_folder() + "' CAIRN_SENSOR='unplug=80 rate=10 frames=" +
                                folder.path().string() + "' CAIRN_VALIDATION=1");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  expect_map("map");
  const auto summary = report("map");
  EXPECT_GT(summary["frames"]["fused"], 4);
  EXPECT_EQ(summary["frames"]["lost"], 0);
  EXPECT_NE(summary["warnings"][0].get<std::string>().find("unplugged"), std::string::npos);
  EXPECT_NEAR(summary["frames"]["total"].get<int>() + summary["live"]["skipped_to_keep_up"].get<int>(), 80, 3);
  EXPECT_GT(summary["live"]["latency_ms"]["p95"], 0);
  if (summary["frames"]["total"] >= 60) {  // else too slow a machine for the stages
    EXPECT_EQ(summary["quality"]["requested"], "good");
    EXPECT_GT(summary["adjusted"]["keyframes"], 2);
    EXPECT_FALSE(summary["stages"].contains("reintegrate"));
    EXPECT_GE(summary["frames"]["held_out"], 1);
  }
}

TEST_F(Live, EqualsReconstructIfEveryFrameIsUsed) {
  ASSERT_EQ(run_cairn({"live", "--no-texture", "--quality", "fast", "synthetic:room", "-o", out("a"),
                       "--as-fast-as-possible"},
                      "timeout --foreground --preserve-status -s INT 6")
                .exit_code,
            0);
  const int frames = report("a")["frames"]["total"];
  ASSERT_GT(frames, 3);
  ASSERT_EQ(run_cairn({"reconstruct", "--no-texture", "--quality", "fast", "synthetic:room", "-o", out("b"), "--frames",
                       "0:" + std::to_string(frames)})
                .exit_code,
            0);
  for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt"})
    EXPECT_EQ(read_bytes(folder / "a" / file) == read_bytes(folder / "b" / file), true) << file;
}

/// Arguments of a run over a small recording in the test's folder.
std::vector<std::string> live_run(const std::string& recording, std::vector<std::string> more = {}) {
  std::vector<std::string> words{"live", recording, "-o", "map", "--no-texture", "--config", recording + ".yaml"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST_F(Live, EndsWithTheSameStagesAsReconstruct) {
  write_small_recording(folder / "rec", {.frames = 70});
  const Ran live = Running(live_run("rec", {"--as-fast-as-possible"}), folder.path()).end();
  ASSERT_EQ(live.exit_code, 0) << live.err;
  const auto summary = report("map");
  EXPECT_EQ(summary["quality"]["requested"], "good");
  EXPECT_GT(summary["quality"]["before"]["frames"], 4);
  EXPECT_EQ(summary["frames"]["fused"], 70) << "held-out frames have not joined the map";
  EXPECT_EQ(summary["frames"]["held_out"], 0);
  EXPECT_NE(live.out.find("quality     good: "), std::string::npos) << live.out;
  const Ran other =
      Running({"reconstruct", "rec", "-o", "other", "--no-texture", "--config", "rec.yaml"}, folder.path()).end();
  ASSERT_EQ(other.exit_code, 0) << other.err;
  for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt"})
    EXPECT_EQ(read_bytes(folder / "map" / file) == read_bytes(folder / "other" / file), true) << file;
}

/// Waits until the stages after the last frame would run.
bool has_frames_for_stages(Running& program, const std::string& of) {
  return program.wait_until([&] {
    const std::string err = program.err();
    const std::size_t end = err.rfind(of), begin = err.find_last_not_of("0123456789", end - 1) + 1;
    return end != std::string::npos && begin < end && std::stoi(err.substr(begin, end - begin)) > 65;
  });
}

TEST_F(Live, SkipsTheStagesAtTheSecondCtrlC) {
  write_small_recording(folder / "rec", {.frames = 250});
  Running program(live_run("rec", {"--quality", "best"}), folder.path(), Running::Errors::to_terminal);
  ASSERT_TRUE(has_frames_for_stages(program, "/250 frames")) << program.err();
  program.send(SIGINT);
  ASSERT_TRUE(program.wait_until([&] { return program.err().find("again to skip this") != std::string::npos; }));
  program.send(SIGINT);
  const Ran ran = program.end();
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("interrupt again to end at once"), std::string::npos) << ran.err;
  expect_map("map");
  const auto summary = report("map");
  EXPECT_LT(summary["frames"]["total"], 250);
  EXPECT_GT(summary["interrupted"]["frames_left"], 0);
  EXPECT_NE(summary["quality"]["words"].get<std::string>().find("skipped"), std::string::npos) << summary["quality"];
}

TEST_F(Live, EndsAtOnceAtTheThirdCtrlC) {
  write_small_recording(folder / "rec", {.frames = 100});
  std::vector<fs::path> images;
  for (const auto& entry : fs::directory_iterator(folder / "rec" / "depth")) images.push_back(entry.path());
  std::sort(images.begin(), images.end());
  const Blocking blocking(images.at(80));  // keeps the program from ending before the third signal
  Running program(live_run("rec", {"--checkpoint", "0.5"}), folder.path(), Running::Errors::to_terminal);
  ASSERT_TRUE(has_frames_for_stages(program, "/100 frames")) << program.err();
  for (const char* message : {"again to skip this", "again to end at once"}) {
    program.send(SIGINT);
    ASSERT_TRUE(program.wait_until([&] { return program.err().find(message) != std::string::npos; })) << program.err();
  }
  program.send(SIGINT);
  const Ran ran = program.end();
  EXPECT_EQ(ran.exit_code, 130) << ran.err;
  EXPECT_NE(ran.err.find("resume with: "), std::string::npos) << ran.err;
}

TEST_F(Live, FinishesAtTheFirstCtrlCWithoutViewers) {
  const Ran ran = run_cairn(
      {"live", "--no-texture", "--quality", "fast", "synthetic:room", "-o", out("map"), "--view", "--port", "0"},
      "timeout --foreground --preserve-status -s INT 6");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(ran.err.find("the page shows"), std::string::npos) << ran.err;
  EXPECT_NE(ran.err.find("interrupt again to end at once"), std::string::npos);
  expect_map("map");
}

TEST_F(Live, WithoutStagesLeavesAResumableSessionAtTheSecondCtrlC) {
  const std::string twice = "f() { \"$@\" & p=$!; sleep 6; kill -INT $p; sleep 0.2; kill -INT $p; wait $p; }; f";
  const Ran ran = run_cairn(
      {"live", "--no-texture", "--quality", "fast", "synthetic:room", "-o", out("map"), "--checkpoint", "0.5"}, twice);
  EXPECT_EQ(ran.exit_code, 130) << ran.err;
  EXPECT_FALSE(fs::exists(folder / "map" / "mesh.glb"));
  const Ran resumed = run_cairn({"reconstruct", "--no-texture", "--quality", "fast", "synthetic:room", "-o", out("map"),
                                 "--resume", "--frames", "0:60"});
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  expect_map("map");
}

TEST_F(Live, ViewDoesNotChangeAReconstruction) {
  write_small_recording(folder / "rec");
  const std::vector<std::string> words{"reconstruct", "rec", "--no-texture", "--config", "rec.yaml", "-o"};
  for (const std::vector<std::string>& more : {std::vector<std::string>{"a"}, {"b", "--view", "--port", "0"}}) {
    std::vector<std::string> all = words;
    all.insert(all.end(), more.begin(), more.end());
    const Ran ran = Running(all, folder.path()).end();
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(ran.err.find("view        http://127.0.0.1:") != std::string::npos, more.size() > 1) << ran.err;
  }
  for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt"})
    EXPECT_EQ(read_bytes(folder / "a" / file) == read_bytes(folder / "b" / file), true) << file;
  EXPECT_EQ(run_cairn({"reconstruct", "synthetic:room", "-o", out("c"), "--view", "--no-mesh"}).exit_code, 2);
}

TEST_F(Live, ReportsViewErrorsInOneLine) {
  const Server server({.port = 0}, {}, nullptr);
  const std::string port = server.url().substr(17, server.url().find('/', 17) - 17);
  expect_one_line(run_cairn({"live", "--no-texture", "synthetic:room", "-o", out("a"), "--view", "--port", port}), 1,
                  "port " + port + " cannot be used");
  expect_one_line(run_cairn({"live", "--no-texture", out("none.oni"), "-o", out("a")}), 1, "there is no such file");
  expect_one_line(run_cairn({"view", folder.path().string()}), 1, "not a map; give an output folder of cairn");
  EXPECT_EQ(run_cairn({"live", "--no-texture", "synthetic:room", "-o", out("a"), "--port", "1"}).exit_code, 2);
  write_text(folder / "report.json", "{\"fra");
  expect_one_line(run_cairn({"view", folder.path().string()}), 1, "is damaged");
}

}  // namespace
}  // namespace cairn
