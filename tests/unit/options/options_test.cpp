// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/options.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "support/files.hpp"

namespace cairn {
namespace {

TEST(Options, AreOverriddenByYaml) {
  const TemporaryFolder folder;
  write_text(folder / "o.yaml", "fuse:\n  voxel_size: 0.02\n  truncation: 0.08\ntrack:\n  levels: 4\n");
  Options options;
  read_options(folder / "o.yaml", options);
  EXPECT_FLOAT_EQ(options.fuse.voxel_size, 0.02f);
  EXPECT_EQ(options.track.levels, 4);
  EXPECT_FLOAT_EQ(options.surface.max_depth, Options{}.surface.max_depth);
}

TEST(Options, DefaultFileHasDefaults) {
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

TEST(Options, RejectUnknownKeysAndBadValuesWithLine) {
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

TEST(Options, AcceptUnitsAndCompareAsTyped) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& text) {
    write_text(folder / "o.yaml", text);
    Options options;
    read_options(folder / "o.yaml", options);
    return options;
  };
  const Options units = read(
      "fuse: {voxel_size: 2cm, truncation: 80mm, device_memory: 1GiB}\ntrack: {max_angle: 30deg, min_inlier_share: "
      "25%}");
  EXPECT_EQ(units.fuse.voxel_size, 0.02f);
  EXPECT_EQ(units.fuse.truncation, 0.08f);
  EXPECT_EQ(units.fuse.device_memory, std::uint64_t{1} << 30);
  EXPECT_NEAR(units.track.max_angle, 0.5236f, 1e-5f);
  EXPECT_EQ(units.track.min_inlier_share, 0.25f);
  // 0.2f is more than 0.2, and 0.002f less than 0.002.
  EXPECT_EQ(read("fuse: {voxel_size: 0.2}").fuse.voxel_size, 0.2f);
  EXPECT_EQ(read("fuse: {voxel_size: 0.002}").fuse.voxel_size, 0.002f);
  Options largest;
  largest.fuse = {.voxel_size = 0.2f, .truncation = 0.8f};
  EXPECT_NO_THROW(check(largest));
}

TEST(Options, RejectNonNumbersByKey) {
  const TemporaryFolder folder;
  for (const auto& [text, key] : {std::pair{"fuse: {voxel_size: .nan}", "fuse.voxel_size"},
                                  {"surface: {max_depth: .inf}", "surface.max_depth"},
                                  {"map: {submap_bricks: 1e3}", "map.submap_bricks"},
                                  {"map: {loops: maybe}", "map.loops"},
                                  {"fuse: {voxel_size: [0.02]}", "fuse.voxel_size"},
                                  {"fuse: {voxel_size: 2s}", "fuse.voxel_size"}}) {
    write_text(folder / "o.yaml", text);
    Options options;
    const std::string error = error_of([&] { read_options(folder / "o.yaml", options); });
    EXPECT_NE(error.find(std::string("o.yaml:1: `") + key + "` has an invalid value; expected "), std::string::npos)
        << error;
  }
  Options options;
  options.esdf.max_distance = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(error_of([&] { check(options); }).find("option esdf.max_distance is nan, allowed: 0.01 to 20 m"),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
