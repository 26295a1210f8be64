// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Calibration found by a run, in its camera file.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "cairn/io/recorder.hpp"
#include "cairn/mapping/rig.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

constexpr double kReadout = 0.028, kReadoutTolerance = 0.003;  // s

/// Recording of a swinging camera with a Kinect's noise and this readout, whose camera.yaml has none.
void write_recording(const std::filesystem::path& folder, double readout) {
  const Camera given = synthetic_camera();
  Camera camera = given;
  camera.readout = readout;
  const Scene scene = synthetic_scene("room");
  SceneRenderer renderer(test_device(), scene, camera);
  Recorder writer(folder, given);
  for (int i = 0; i < 90; ++i) {
    auto images = renderer.render(swung_in(scene), i / 30.0);
    add_noise(images, camera, "kinect", 1, i);
    writer.add(
        encode({.index = i, .timestamp = i / 30.0, .depth = std::move(images.depth), .color = std::move(images.color)},
               given));
  }
}

TEST(Calibration, FoundByARunIsTakenOverByTheNext) {
  const TemporaryFolder folder;
  write_recording(folder / "rec", kReadout);
  const auto run_in = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--no-texture", "--voxel-size", "0.02"});
    const Ran ran = run_cairn(arguments, "cd '" + folder.path().string() + "'; ");
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return ran.out;
  };
  const std::string out = run_in({"reconstruct", "rec", "-o", "map"});
  const double found = read_rig(folder / "map" / "map_camera.yaml").depth.readout;
  EXPECT_NEAR(found, kReadout, kReadoutTolerance);
  const auto report = nlohmann::json::parse(read_bytes(folder / "map" / "report.json"));
  EXPECT_EQ(report["calibration"]["readout"], found);
  EXPECT_EQ(report["camera"], "map_camera.yaml");
  EXPECT_NE(out.find("\ncalibration "), std::string::npos) << out;
  EXPECT_EQ(out.find("cairn calibrate"), std::string::npos) << out;
  run_in({"reconstruct", "rec", "-o", "next", "--camera", "map/map_camera.yaml", "--quality", "fast"});
  EXPECT_EQ(read_rig(folder / "next" / "map_camera.yaml").depth.readout, found);
  run_in({"reconstruct", "rec", "-o", "map", "--resume"});
  EXPECT_EQ(read_rig(folder / "map" / "map_camera.yaml").depth.readout, found);
}

TEST(Calibration, OfAGlobalShutterIsTheGivenOne) {
  const TemporaryFolder folder;
  write_recording(folder / "rec", 0);
  const Ran ran = run_cairn({"reconstruct", "rec", "-o", "map", "--no-texture", "--voxel-size", "0.02"},
                            "cd '" + folder.path().string() + "'; ");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(read_rig(folder / "map" / "map_camera.yaml").depth, synthetic_camera());
}

}  // namespace
}  // namespace cairn
