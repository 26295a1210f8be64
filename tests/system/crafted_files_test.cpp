// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Limits on memory, time and stack for crafted files.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/cost.hpp"
#include "support/crafted.hpp"
#include "support/files.hpp"
#include "support/zips.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kLongest = 10;   // seconds
constexpr double kMostTimes = 2;  // of the memory used for a regular file

/// Recording of one depth image and one color image with these bytes.
void write_tum(const fs::path& folder, const std::string& color) {
  fs::create_directories(folder / "rgb");
  fs::create_directories(folder / "depth");
  write_text(folder / "camera.yaml",
             "width: 640\nheight: 480\nfx: 525\nfy: 525\ncx: 319.5\ncy: 239.5\ndepth_scale: 5000\n");
  write_text(folder / "rgb.txt", "1.0 rgb/1.png\n");
  write_text(folder / "depth.txt", "1.0 depth/1.png\n");
  write_text(folder / "depth/1.png", black_png(640, 480, 16));
  write_text(folder / "rgb/1.png", color);
}

void expect_no_harm(const Cost& cost, const std::string& what, double most_mb) {
  EXPECT_TRUE(cost.ended) << "crashed, or took too long";
  EXPECT_NE(cost.error.find(what), std::string::npos) << cost.error;
  EXPECT_LT(cost.seconds, kLongest);
  EXPECT_LT(cost.peak_mb, most_mb);
}

TEST(CraftedFilesInTheProgram, JsonNestedDeeplyEndsInOneLine) {
  const TemporaryFolder folder;
  const double plain = cost_of_cairn({"info", folder / "nothing"}).peak_mb;
  const auto file = [&](const std::string& name, const std::string& text) {
    fs::create_directories((folder / name).parent_path());
    write_text(folder / name, text);
  };
  const std::string deep = nested(200'000);
  file("map/report.json", R"({"frames":)" + deep + "}");
  file("map/trajectory.txt", "0 0 0 0 0 0 0 1\n");
  file("tiles/tileset.json", R"({"asset":{"version":"1.1"},"root":{"a":)" + deep + "}}");
  file("plan/plan.json", R"({"kind":)" + deep + "}");
  file("part/part.json", R"({"kind":)" + deep + "}");
  file("nerf/transforms.json", R"({"frames":[{"transform_matrix":)" + deep + R"(,"w":4}]})");
  file("camera/intrinsics.json", R"({"K":)" + nested(32'000) + "}");
  write_text(folder / "mesh.gltf", R"({"asset":{"version":"2.0"},"extras":)" + deep + "}");
  fs::create_directories(folder / "camera/depth");
  write_text(folder / "camera/depth/1.png", black_png(64, 48, 16));
  const std::vector<std::vector<std::string>> runs{{"info", folder / "map"},
                                                   {"view", folder / "map", "--port", "0"},
                                                   {"view", folder / "tiles/tileset.json", "--port", "0"},
                                                   {"view", folder / "mesh.gltf", "--port", "0"},
                                                   {"tileset", folder / "plan", "-o", folder / "t.json"},
                                                   {"info", folder / "part"},
                                                   {"info", folder / "nerf"},
                                                   {"info", folder / "camera"},
                                                   {"evaluate", "loops", folder / "map/report.json", folder / "nerf"},
                                                   {"evaluate", "topology", folder / "mesh.gltf"}};
  for (const auto& run : runs) {
    SCOPED_TRACE(fmt::format("{}", fmt::join(run, " ")));
    const Cost cost = cost_of_cairn(run);
    expect_no_harm(cost, "", kMostTimes * plain + 50);
    EXPECT_FALSE(cost.error.empty());
    EXPECT_EQ(cost.error.find('\n'), cost.error.size() - 1) << cost.error;
  }
}

TEST(CraftedFilesInTheProgram, ImageOfFewBytesTakesNoMoreMemoryThanAnHonestOne) {
  const TemporaryFolder folder;
  write_tum(folder / "honest", black_png(640, 480, 8, 2));
  write_tum(folder / "bomb", black_png(30'000, 30'000));
  EXPECT_LT(fs::file_size(folder / "bomb/rgb/1.png"), 200'000u);
  for (const char* command : {"info", "reconstruct"}) {
    SCOPED_TRACE(command);
    const auto run = [&](const std::string& recording) {
      std::vector<std::string> words{command, folder / recording};
      if (command == std::string("reconstruct")) words.insert(words.end(), {"-o", folder / (recording + "-map")});
      return cost_of_cairn(words);
    };
    const Cost honest = run("honest"), bomb = run("bomb");
    RecordProperty(std::string(command) + "_honest_mb", std::to_string(honest.peak_mb));
    RecordProperty(std::string(command) + "_bomb_mb", std::to_string(bomb.peak_mb));
    expect_no_harm(bomb, "", kMostTimes * honest.peak_mb);
  }
}

TEST(CraftedFilesInTheProgram, ArchiveUnpacksNowhereElse) {
  const TemporaryFolder folder, place;
  write_text(place / "victim.txt", "mine\n");
  write_zip(folder / "...zip", {{"victim.txt", "from the archive\n"}, {"sub/evil.sh", "echo\n"}});
  const Ran ran = run_cairn({"info", folder / "...zip"}, "TMPDIR='" + place.path().string() + "'");
  expect_one_line(ran, 1, "...zip");
  EXPECT_EQ(read_bytes(place / "victim.txt"), "mine\n");
  EXPECT_EQ(std::distance(fs::directory_iterator(place.path()), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace cairn
