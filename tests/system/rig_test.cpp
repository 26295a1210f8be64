// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Sensor with a color camera beside the depth camera, and different image sizes.

#include "cairn/mapping/rig.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/eval/evaluation.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRig = R"(
width: 320
height: 240
fx: 262.5
fy: 262.5
cx: 159.5
cy: 119.5
color:
  width: 640
  height: 360
  fx: 460
  fy: 460
  cx: 319.5
  cy: 179.5
  distortion: [0.05, -0.03, 0.001, -0.001, 0.002]
  translation: [-0.05, 0, 0]
  rotation: [0, 0.0261769, 0, 0.9996573]
)";

/// PSNR of the mesh's texture against the color images.
double psnr_of(const fs::path& map, const fs::path& recording) {
  const Ran ran = run_cairn({"evaluate", "views", (map / "mesh.glb").string(), recording.string(), "--trajectory",
                             (map / "trajectory.txt").string(), "--truth-trajectory", recording.string(), "--json"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  return ran.exit_code == 0 ? nlohmann::json::parse(ran.out)["psnr_db"].get<double>() : 0;
}

TEST(Rig, IsTrackedFusedAndTexturedFromBothOfItsCameras) {
  const TemporaryFolder folder;
  write_text(folder / "rig.yaml", kRig);
  const fs::path recording = folder / "recording", map = folder / "map";
  Ran ran = run_cairn(
      {"synth", "room", "-o", recording.string(), "--frames", "40", "--camera", (folder / "rig.yaml").string()});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const std::vector<std::string> reconstruct{"reconstruct", recording.string(), "-o",   map.string(),
                                             "--texture",   "--voxel-size",     "0.02", "--json"};
  ran = run_cairn(reconstruct, "CAIRN_VALIDATION=1");
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(nlohmann::json::parse(ran.out)["frames"]["fused"], 40);
  EXPECT_EQ(ran.err.find("Validation"), std::string::npos) << ran.err;
  const auto error =
      evaluate_trajectory(read_trajectory(map / "trajectory.txt"), read_trajectory(recording / "groundtruth.txt"));
  EXPECT_LT(error.ate.rmse, 0.004);
  const double psnr = psnr_of(map, recording);
  RecordProperty("psnr_db", std::to_string(psnr));
  EXPECT_GT(psnr, 26);
  // Check of the test: without the baseline of the cameras the texture is misaligned.
  const std::string told = read_bytes(recording / "camera.yaml");
  const auto at = told.find("translation: [");
  ASSERT_NE(at, told.npos);
  std::string wrong = told;
  write_text(recording / "camera.yaml", wrong.replace(at, told.find(']', at) - at + 1, "translation: [0, 0, 0]"));
  fs::remove_all(map);
  ASSERT_EQ(run_cairn(reconstruct).exit_code, 0);
  write_text(recording / "camera.yaml", told);
  const double without = psnr_of(map, recording);
  RecordProperty("psnr_without_db", std::to_string(without));
  EXPECT_LT(without, psnr - 2);
}

/// Mean distance in pixels between the projections of a room's points into two color cameras.
double apart(const ColorCamera& a, const ColorCamera& b, const Camera& depth) {
  double sum = 0;
  int count = 0;
  for (const double z : {1.0, 2.0, 3.0})
    for (int y = 20; y < depth.height; y += 40)
      for (int x = 20; x < depth.width; x += 40, ++count) {
        const auto seen = [&](const ColorCamera& c) {
          return c.camera.project(c.color_from_depth * Eigen::Vector3d(z * depth.ray(x, y)));
        };
        sum += (seen(a) - seen(b)).norm();
      }
  return sum / count;
}

TEST(Rig, FindsAColorCameraThatIsNotWhereItIsSaidToBe) {
  const TemporaryFolder folder;
  const fs::path recording = folder / "recording", found = folder / "found.yaml";
  Rig truth(Camera{.width = 320, .height = 240, .fx = 262.5, .fy = 262.5, .cx = 159.5, .cy = 119.5});
  truth.color.emplace().camera = truth.depth;
  Rig wrong = truth;
  truth.color->camera.fx = truth.color->camera.fy = 240;  // as a Kinect's two lenses differ
  truth.color->color_from_depth.translation().x() = -0.025;
  write_rig(folder / "truth.yaml", truth);
  write_rig(folder / "wrong.yaml", wrong);
  EXPECT_EQ(read_rig(folder / "truth.yaml"), truth);
  Ran ran = run_cairn(
      {"synth", "room", "-o", recording.string(), "--frames", "120", "--camera", (folder / "truth.yaml").string()});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  ran =
      run_cairn({"calibrate", recording.string(), "--camera", (folder / "wrong.yaml").string(), "-o", found.string()});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  ASSERT_TRUE(fs::exists(found)) << ran.out;
  const double before = apart(*wrong.color, *truth.color, truth.depth),
               after = apart(*read_rig(found).color, *truth.color, truth.depth);
  RecordProperty("pixels", std::to_string(before) + " " + std::to_string(after));
  EXPECT_LT(after, 0.1 * before);
  fs::remove(found);
  ran = run_cairn({"calibrate", recording.string(), "-o", found.string()});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_FALSE(fs::exists(found)) << "a camera that is told right: " << ran.out;
}

}  // namespace
}  // namespace cairn
