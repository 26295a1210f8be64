// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The program with stand-ins for the libraries of RealSense and Azure Kinect: tests/support/sensor.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

/// Environment with the stand-ins, both configured with these words.
std::string sensors(const std::string& behavior = "") {
  return "LD_LIBRARY_PATH='" + sensor_folder() + "' CAIRN_REALSENSE='" + behavior + "' CAIRN_K4A='" + behavior + "'";
}

/// Binary chunk of a .glb file: without the name of the source.
std::string mesh_in(const std::filesystem::path& file) {
  const std::string bytes = read_bytes(file);
  std::uint32_t json = 0;  // bytes, after the file's header and the chunk's
  if (bytes.size() > 20) std::memcpy(&json, &bytes[12], sizeof json);
  return bytes.substr(std::min<std::size_t>(bytes.size(), 20 + json));
}

class Sensors : public testing::Test {
 protected:
  [[nodiscard]] std::string out(const std::string& name) const { return (folder / name).string(); }
  /// Renders a room with the cameras of the `small` RealSense, and writes its images for the stand-in.
  void show_room() const {
    write_text(
        folder / "camera.yaml",
        "width: 480\nheight: 270\nfx: 240\nfy: 240\ncx: 239.5\ncy: 134.5\ncolor: {width: 424, height: 240, fx: 318, "
        "fy: 318, cx: 211.5, cy: 119.5, translation: [-0.015, 0, 0], rotation: [0, 0, 0, 1]}\n");
    ASSERT_EQ(
        run_cairn({"synth", "room", "-o", out("room"), "--frames", "40", "--camera", out("camera.yaml")}).exit_code, 0);
    const auto room = open_source(out("room"));
    for (int i = 0; const auto frame = room->next(); ++i) {
      std::ofstream depth(folder / ("depth-" + std::to_string(i) + ".raw"), std::ios::binary);
      std::ofstream color(folder / ("color-" + std::to_string(i) + ".raw"), std::ios::binary);
      for (const float z : frame->depth) {
        const auto units = static_cast<std::uint16_t>(std::lround(5000 * z));
        depth.write(reinterpret_cast<const char*>(&units), 2);
      }
      for (const std::uint32_t& pixel : frame->color) color.write(reinterpret_cast<const char*>(&pixel), 3);
    }
  }
  TemporaryFolder folder;
};

TEST_F(Sensors, MapEqualsTheMapOfTheRecordedFrames) {
  show_room();
  const std::string images = "small noimu frames=" + folder.path().string();
  Ran ran =
      run_cairn({"record", "realsense:", "-o", out("recording"), "--seconds", "1", "--color", "png"}, sensors(images));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  write_text(folder / "options.yaml", "track: {finest_level: 1}\n");  // the default depends on the command
  const auto run = [&](std::vector<std::string> words, const std::string& output, const std::string& environment) {
    for (const char* word : {"--no-texture", "--quality", "fast", "--voxel-size", "0.03", "--config"})
      words.push_back(word);
    words.insert(words.end(), {out("options.yaml"), "-o", out(output)});
    return run_cairn(words, environment);
  };
  ran = run({"live", "realsense:", "--as-fast-as-possible"}, "live",
            "timeout --foreground --preserve-status -s INT 6 env " + sensors(images + " rate=4"));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto report = nlohmann::json::parse(read_bytes(folder / "live" / "report.json"));
  const int frames = report["frames"]["total"];
  EXPECT_GT(frames, 3);
  EXPECT_EQ(report["frames"]["fused"], frames);
  ran = run({"reconstruct", out("recording"), "--frames", "0:" + std::to_string(frames)}, "reconstructed", "");
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  for (const char* file : {"map.vdb", "trajectory.txt"})
    EXPECT_TRUE(read_bytes(folder / "live" / file) == read_bytes(folder / "reconstructed" / file)) << file;
  EXPECT_TRUE(mesh_in(folder / "live" / "mesh.glb") == mesh_in(folder / "reconstructed" / "mesh.glb"));
}

TEST_F(Sensors, RecordingContinuesAfterAnUnplug) {
  for (const std::string input : {"realsense:", "k4a:"}) {
    const std::string name = input.substr(0, input.size() - 1);
    const Ran ran = run_cairn({"record", input, "-o", out(name), "--seconds", "4", "--json"},
                              sensors("small unplug=10 replug=2.5"));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_NE(ran.err.find(name + ": the sensor is back"), std::string::npos) << ran.err;
    const auto result = nlohmann::json::parse(ran.out);
    EXPECT_GT(result["frames"], 12);
    EXPECT_EQ(result["dropped"], 0);
  }
}

TEST_F(Sensors, LiveRunWaitsForAnUnpluggedSensorUntilCtrlC) {
  const Ran ran =
      run_cairn({"live", "realsense:", "--no-texture", "--quality", "fast", "--voxel-size", "0.03", "-o", out("map")},
                "timeout --foreground --preserve-status -s INT 6 env " + sensors("noimu unplug=3"));
  EXPECT_NE(ran.err.find("realsense: the sensor was unplugged"), std::string::npos) << ran.err;
  EXPECT_LT(ran.exit_code, 4) << ran.err;
  EXPECT_TRUE(std::filesystem::exists(folder / "map" / "mesh.glb"));
}

TEST_F(Sensors, MissingAndOldLibrariesAreReportedInOneLine) {
  const auto record = [&](const char* input, const std::string& environment) {
    return run_cairn({"record", input, "-o", out("a")}, environment);
  };
  expect_one_line(record("realsense:", "CAIRN_REALSENSE=old LD_LIBRARY_PATH='" + sensor_folder() + "'"), 1,
                  "the installed version is 2.10.0: install version 2.24 or later");
  expect_one_line(record("k4a:", "LD_LIBRARY_PATH='" + old_sensor_folder() + "'"), 1,
                  "lacks k4a_image_get_device_timestamp_usec: install version 1.2 or later");
  expect_one_line(record("realsense:", sensors("none")), 1, "no RealSense camera is plugged in");
  expect_one_line(record("k4a:", sensors("none")), 1, "no Azure Kinect or Femto is plugged in");
  const Ran missing = record("realsense:", "");
  if (missing.err.find("librealsense2.so is not installed") == std::string::npos)
    GTEST_SKIP() << "librealsense2 is installed: " << missing.err;
  expect_one_line(missing, 1, "RealSense cameras need librealsense2");
  expect_one_line(record("k4a:", ""), 1, "Azure Kinect and Femto need libk4a");
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

TEST_F(Sensors, AreListedByDevices) {
  const Ran ran = run_cairn({"devices", "--sensors"}, sensors("two"));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  for (const char* text : {"realsense:123622270002    Intel RealSense D435I", "k4a:000145594513"})
    EXPECT_NE(ran.out.find(text), std::string::npos) << ran.out;
}

TEST_F(Sensors, OnlyOpenNiRecordsOniFiles) {
  expect_one_line(run_cairn({"record", "realsense:", "-o", out("a.oni")}, sensors()), 1, "only OpenNI2 sources");
}

}  // namespace
}  // namespace cairn
