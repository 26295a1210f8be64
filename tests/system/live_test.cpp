// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// `cairn live` without a browser; with a browser: tests/system/browser.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "support/files.hpp"
#include "synth/source.hpp"
#include "view/server.hpp"

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
  const Ran ran = run_cairn({"live", "--no-texture", "openni:", "-o", out("map")},
                            "LD_LIBRARY_PATH='" + openni_folder() +
                                "' CAIRN_SENSOR='unplug=80 frames=" + folder.path().string() + "' CAIRN_VALIDATION=1");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  expect_map("map");
  const auto summary = report("map");
  EXPECT_GT(summary["frames"]["fused"], 4);
  EXPECT_EQ(summary["frames"]["lost"], 0);
  EXPECT_NE(summary["warnings"][0].get<std::string>().find("unplugged"), std::string::npos);
  EXPECT_NEAR(summary["frames"]["total"].get<int>() + summary["live"]["skipped_to_keep_up"].get<int>(), 80, 3);
  EXPECT_GT(summary["live"]["latency_ms"]["p95"], 0);
}

TEST_F(Live, EqualsReconstructIfEveryFrameIsUsed) {
  ASSERT_EQ(run_cairn({"live", "--no-texture", "synthetic:room", "-o", out("a"), "--as-fast-as-possible"},
                      "timeout --foreground --preserve-status -s INT 6")
                .exit_code,
            0);
  const int frames = report("a")["frames"]["total"];
  ASSERT_GT(frames, 3);
  ASSERT_EQ(run_cairn({"reconstruct", "--no-texture", "synthetic:room", "-o", out("b"), "--frames",
                       "0:" + std::to_string(frames)})
                .exit_code,
            0);
  for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt"})
    EXPECT_EQ(read_bytes(folder / "a" / file) == read_bytes(folder / "b" / file), true) << file;
}

TEST_F(Live, FinishesAtTheFirstCtrlCWithoutViewers) {
  const Ran ran = run_cairn({"live", "--no-texture", "synthetic:room", "-o", out("map"), "--view", "--port", "0"},
                            "timeout --foreground --preserve-status -s INT 6");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(ran.err.find("the page shows"), std::string::npos) << ran.err;
  EXPECT_NE(ran.err.find("interrupt again to end at once"), std::string::npos);
  expect_map("map");
}

TEST_F(Live, LeavesAResumableSessionAtTheSecondCtrlC) {
  const std::string twice = "f() { \"$@\" & p=$!; sleep 6; kill -INT $p; sleep 0.2; kill -INT $p; wait $p; }; f";
  const Ran ran = run_cairn({"live", "--no-texture", "synthetic:room", "-o", out("map"), "--checkpoint", "0.5"}, twice);
  EXPECT_EQ(ran.exit_code, 130) << ran.err;
  EXPECT_FALSE(fs::exists(folder / "map" / "mesh.glb"));
  const Ran resumed =
      run_cairn({"reconstruct", "--no-texture", "synthetic:room", "-o", out("map"), "--resume", "--frames", "0:60"});
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  expect_map("map");
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
