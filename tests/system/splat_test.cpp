// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// `cairn splat`: training from a map, its files, and their comparison with images.
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "cairn/mapping/splats.hpp"
#include "support/files.hpp"
#include "support/running.hpp"
#include "support/shared.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

fs::path room() { return shared_recording({"room", "--frames", "60"}); }
fs::path map_of_room() { return shared_map(room(), {"--voxel-size", "0.02"}); }

Json trained(const fs::path& file, std::vector<std::string> options) {
  options.insert(options.begin(), {"splat", map_of_room().string(), "-o", file.string(), "--json"});
  const Ran ran = run_cairn(options);
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  return ran.exit_code == 0 ? Json::parse(ran.out) : Json{};
}

TEST(Splat, TrainsFromAMapAndJudgesItsHeldOutKeyframes) {
  const TemporaryFolder out;
  const Json report = trained(out / "a.ply", {"--iterations", "120", "--max-splats", "30000", "--hold-out", "5"});
  EXPECT_EQ(report["iterations"], 120);
  EXPECT_GE(report["images"], 5);
  EXPECT_LE(report["splats"], 30000);
  EXPECT_GE(report["held_out"]["frames"], 1);
  EXPECT_GT(report["held_out"]["psnr_db"], 22);
  EXPECT_GT(report["held_out"]["covered"], 0.9);
  EXPECT_GT(report["mesh"]["psnr_db"], 15);
  EXPECT_EQ(read_splats(out / "a.ply").size(), report["splats"]);
  const Ran ran = run_cairn({"evaluate", "views", (out / "a.ply").string(), room().string(), "--trajectory",
                             (map_of_room() / "trajectory.txt").string(), "--truth-trajectory", room().string(),
                             "--step", "20", "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_GT(Json::parse(ran.out)["psnr_db"], 20);
}

TEST(Splat, TrainsFromTheFramesOfTheRecording) {
  const TemporaryFolder out;
  const Json report = trained(out / "x.spz", {"--recording", room().string(), "--iterations", "60", "--max-splats",
                                              "20000", "--images", "20", "--hold-out", "6"});
  EXPECT_EQ(report["images"], 20);
  EXPECT_EQ(report["held_out"]["frames"], 10);  // of 60
  EXPECT_GT(report["held_out"]["psnr_db"], 20);
  EXPECT_GT(report["held_out"]["covered"], 0.9);
  EXPECT_GT(report["mesh"]["psnr_db"], 15);
  EXPECT_LT(report["bytes"], 20 * report["splats"].get<int>());  // 68 in .ply
  const Ran ran = run_cairn({"evaluate", "views", (out / "x.spz").string(), room().string(), "--trajectory",
                             (map_of_room() / "trajectory.txt").string(), "--truth-trajectory", room().string(),
                             "--step", "20", "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NEAR(Json::parse(ran.out)["psnr_db"], report["held_out"]["psnr_db"], 3);
}

TEST(Splat, WritesTheSameBytesTwice) {
  const TemporaryFolder out;
  for (const char* name : {"a.ply", "b.ply"})
    (void)trained(out / name, {"--iterations", "20", "--max-splats", "5000", "--resolution", "0.2", "--hold-out", "0",
                               "--recording", room().string(), "--images", "10"});
  EXPECT_TRUE(read_bytes(out / "a.ply") == read_bytes(out / "b.ply"));  // without printing megabytes
}

TEST(Splat, InterruptedTrainingWritesItsSplats) {
  const TemporaryFolder out;
  Running program({"splat", map_of_room().string(), "-o", "x.ply", "--iterations", "1000000", "--max-splats", "2000",
                   "--resolution", "0.1"},
                  out.path());
  ASSERT_TRUE(program.wait_until([&] { return program.err().find("PSNR") != std::string::npos; })) << program.err();
  program.send(SIGINT);
  const Ran ran = program.end();
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("writing the splats so far"), std::string::npos) << ran.err;
  EXPECT_GT(read_splats(out / "x.ply").size(), 100);
}

TEST(Splat, InterruptedTrainingFromARecordingWritesItsSplats) {
  const TemporaryFolder out;
  Running program({"splat", map_of_room().string(), "-o", "x.spz", "--recording", room().string(), "--iterations",
                   "1000000", "--max-splats", "2000", "--resolution", "0.1"},
                  out.path());
  ASSERT_TRUE(program.wait_until([&] { return program.err().find("PSNR") != std::string::npos; })) << program.err();
  program.send(SIGINT);
  const Ran ran = program.end();
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(ran.out.find("held out"), std::string::npos) << ran.out;
  EXPECT_GT(read_splats(out / "x.spz").size(), 100);
}

TEST(Splat, EndsAtItsTimeLimit) {
  const TemporaryFolder out;
  const Json report = trained(out / "x.ply", {"--iterations", "1000000", "--time", "2s", "--max-splats", "2000",
                                              "--resolution", "0.1", "--hold-out", "0"});
  EXPECT_LT(report["iterations"], 1000000);
  EXPECT_GE(report["seconds"], 2);
  EXPECT_FALSE(report.contains("held_out"));
}

TEST(Splat, ReconstructTrainsThemAfterTheRun) {
  const TemporaryFolder out;
  const fs::path map = out / "map";
  const Ran ran = run_cairn({"reconstruct", room().string(), "-o", map.string(), "--voxel-size", "0.02", "--frames",
                             "0:40", "--quality", "fast", "--splat", "3s", "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const Splats splats = read_splats(map / "splats.spz");
  for (const Json& report : {Json::parse(ran.out), Json::parse(read_bytes(map / "report.json"))}) {
    EXPECT_EQ(report["splats"]["splats"], splats.size());
    EXPECT_GE(report["splats"]["seconds"], 3);
    EXPECT_GT(report["splats"]["held_out"]["psnr_db"], 15);
    EXPECT_GT(report["splats"]["memory_bytes"], 1 << 20);
  }
  EXPECT_NE(read_bytes(map / "report.html").find("splats.spz"), std::string::npos);
  // Splats of an earlier map do not remain beside a new one.
  const Ran again = run_cairn({"reconstruct", room().string(), "-o", map.string(), "--voxel-size", "0.02", "--frames",
                               "0:20", "--quality", "fast", "--overwrite"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_FALSE(fs::exists(map / "splats.spz"));
  EXPECT_EQ(read_bytes(map / "report.html").find("splats.spz"), std::string::npos);
  const Ran later = run_cairn({"splat", map.string(), "-o", (map / "splats.spz").string(), "--iterations", "3",
                               "--resolution", "0.1", "--hold-out", "0"});
  ASSERT_EQ(later.exit_code, 0) << later.err;
  EXPECT_NE(read_bytes(map / "report.html").find("splats.spz"), std::string::npos);
}

TEST(Splat, InterruptedReconstructWritesItsSplats) {
  const TemporaryFolder out;
  Running program({"reconstruct", room().string(), "-o", "map", "--voxel-size", "0.02", "--frames", "0:20", "--quality",
                   "fast", "--splat", "1h"},
                  out.path());
  ASSERT_TRUE(program.wait_until([&] { return program.err().find("splats, PSNR") != std::string::npos; }))
      << program.err();
  program.send(SIGINT);
  const Ran ran = program.end();
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("writing the splats so far"), std::string::npos) << ran.err;
  EXPECT_GT(read_splats(out / "map" / "splats.spz").size(), 100);
  EXPECT_FALSE(Json::parse(read_bytes(out / "map" / "report.json"))["splats"].contains("held_out"));
}

TEST(Splat, WritesGltf) {
  const TemporaryFolder out;
  const Json report =
      trained(out / "x.glb", {"--iterations", "5", "--max-splats", "2000", "--resolution", "0.1", "--hold-out", "5"});
  EXPECT_GT(report["held_out"]["depth_rmse_m"], 0);
  EXPECT_LT(report["held_out"]["depth_rmse_m"], 0.05);
  EXPECT_NE(read_bytes(out / "x.glb").find("KHR_gaussian_splatting"), std::string::npos);
}

TEST(Splat, RefusesInputsWithTheRemedy) {
  const TemporaryFolder out;
  const auto refused = [&](std::vector<std::string> arguments, int exit_code, const std::string& what) {
    arguments.insert(arguments.begin(), "splat");
    expect_last_line(run_cairn(arguments), exit_code, what);
    EXPECT_TRUE(fs::is_empty(out.path()));
  };
  const std::string map = map_of_room().string(), file = (out / "x.ply").string();
  const std::string given =
      shared_map(room(), {"--voxel-size", "0.02", "--frames", "0:20", "--poses", (room() / "groundtruth.txt").string()})
          .string();
  refused({map, "-o", (out / "x.obj").string()}, 2, "is not X.spz, X.ply or X.glb");
  refused({map + "/map.vdb", "-o", file}, 1, "give the folder written by reconstruct");
  refused({given, "-o", file}, 1, "has no keyframes");
  refused({map, "-o", file, "--iterations", "-1"}, 2, "--iterations");
  refused({map, "-o", file, "--resolution", "2"}, 2, "--resolution");
  refused({(out / "nothing").string(), "-o", file}, 2, "nothing");
  refused({map, "-o", file, "--recording", (out / "nothing").string()}, 2, "--recording");
  refused({map, "-o", file, "--recording", shared_recording({"room", "--frames", "2", "--width", "64"}).string()}, 1,
          "images of another size than the map's");
}

}  // namespace
}  // namespace cairn
