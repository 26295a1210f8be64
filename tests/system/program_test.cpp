// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Program from a user's view.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cairn/eval/evaluation.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/esdf.hpp"
#include "cairn/synthetic/scene.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"
#include "support/shared.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

nlohmann::json json_of(const Ran& ran) {
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  return ran.exit_code == 0 ? nlohmann::json::parse(ran.out) : nlohmann::json{};
}

class Program : public testing::Test {
 protected:
  static std::string sequence() { return shared_recording({"room", "--frames", "40", "--noise", "kinect"}).string(); }
  static std::string exact() { return shared_recording({"room", "--frames", "30", "--noise", "none"}).string(); }
  /// Map of the sequence with default options.
  static fs::path map_of_sequence() { return shared_map(sequence(), {}); }
  TemporaryFolder out;
};

TEST_F(Program, ReconstructsARoomWithinACentimeter) {
  const auto map = (out / "map").string();
  const auto report =
      json_of(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--json"}, "CAIRN_VALIDATION=1"));
  EXPECT_EQ(report["frames"]["fused"], 40);
  EXPECT_EQ(report["frames"]["lost"], 0);
  EXPECT_GT(report["kernels"]["tsdf_integrate"]["total_ms"], 0.0);
  for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt", "report.json"})
    EXPECT_TRUE(fs::exists(map + "/" + file)) << file;
  EXPECT_EQ(validate_gltf(map + "/mesh.glb"), "");
  const auto error = json_of(
      run_cairn({"evaluate", "trajectory", map + "/trajectory.txt", sequence() + "/groundtruth.txt", "--json"}));
  EXPECT_LT(error["ate_m"]["rmse"], 0.01);
  EXPECT_EQ(error["matched_poses"], 40);
}

TEST_F(Program, FusesTheTrueSurfaceFromTruePoses) {
  const std::string exact = Program::exact(), map = (out / "map").string();
  ASSERT_EQ(
      run_cairn({"reconstruct", "--no-texture", exact, "-o", map, "--poses", exact + "/groundtruth.txt"}).exit_code, 0);
  const auto error = json_of(run_cairn({"evaluate", "mesh", map + "/mesh.glb", exact + "/groundtruth_mesh.ply",
                                        "--seen", exact + "/groundtruth_seen.ply", "--json"}));
  EXPECT_LT(error["accuracy_m"]["mean"], 0.002);
  EXPECT_GT(error["at"][1]["recall"], 0.95);  // within a second, much of the surface is seen only from afar or at a
                                              // grazing angle
}

TEST_F(Program, MeasuresTheTimePerFrame) {
  const auto result = json_of(run_cairn({"bench", sequence(), "--json"}));
  EXPECT_EQ(result["fused"], 40);
  double stages = 0;
  for (const char* stage : {"preprocess", "raycast", "track", "fuse"})
    stages += result["stages"][stage]["per_frame_ms"].get<double>();
  EXPECT_GT(stages, 0.5 * result["frame"]["mean_ms"].get<double>());
  EXPECT_LE(stages, 1.01 * result["frame"]["mean_ms"].get<double>());
  EXPECT_GE(result["waits_per_frame"], 2.0);  // for the pose, and for the integration
  EXPECT_LE(result["waits_per_frame"], 2.5);  // and rarely for more
  EXPECT_EQ(result["kernels"]["tsdf_integrate"]["calls_per_frame"], 1.0);
  EXPECT_GE(result["bytes_up_per_frame"], 640 * 480 * 8.0);  // depth and color
  EXPECT_GT(result["bytes_down_per_frame"], 0.0);
  EXPECT_GT(result["reference_ms"], 0.0);
  EXPECT_NE(run_cairn({"bench", sequence(), "--frames", "0:12"}).out.find("the host waits"), std::string::npos);
  EXPECT_NE(run_cairn({"bench", sequence(), "--frames", "0:1"}).err.find("fewer than two frames"), std::string::npos);
}

TEST_F(Program, WritesTheSameBytesFromTheSameInput) {
  for (const char* name : {"a", "b"})
    ASSERT_EQ(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", (out / name).string(), "--frames", "0:20"})
                  .exit_code,
              0);
  for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt"})
    EXPECT_EQ(read_bytes(out / "a" / file), read_bytes(out / "b" / file)) << file;
}

TEST_F(Program, WritesTheSameBytesAfterALoopWithOneThreadAndOneCore) {
  write_small_recording(out / "loop", {.frames = 40, .speed = 4, .turns_at = 2.6});
  const auto run = [&](const char* name, const std::string& environment) {
    return json_of(run_cairn({"reconstruct", "--no-texture", (out / "loop").string(), "-o", (out / name).string(),
                              "--config", (out / "loop.yaml").string(), "--refine", "--json"},
                             environment));
  };
  EXPECT_GT(run("a", "")["loops"].size(), 0u);
  (void)run("b", "LP_NUM_THREADS=1 taskset -c 0");
  for (const char* file : {"mesh.glb", "map.vdb", "trajectory.txt", "graph.g2o"})
    EXPECT_EQ(read_bytes(out / "a" / file), read_bytes(out / "b" / file)) << file;
}

TEST_F(Program, CompletesWithLittleDeviceMemory) {
  // A smaller voxel, so that the map exceeds the budget.
  const auto run = [&](const char* name, std::vector<std::string> more) {
    std::vector<std::string> arguments{"reconstruct",
                                       "--no-texture",
                                       sequence(),
                                       "-o",
                                       (out / name).string(),
                                       "--voxel-size",
                                       "0.006",
                                       "--poses",
                                       sequence() + "/groundtruth.txt",
                                       "--frames",
                                       "0:40:2",
                                       "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return json_of(run_cairn(arguments));
  };
  const auto all = run("all", {}), little = run("little", {"--device-memory", "130"});
  EXPECT_GT(little["bricks"]["paged_out"], 1000);
  const auto error = evaluate_mesh(read_mesh(out / "little" / "mesh.glb"), read_mesh(out / "all" / "mesh.glb"), 50000);
  EXPECT_LT(error.accuracy.mean, 0.001);
  EXPECT_LT(error.completeness.mean, 0.001);
}

TEST_F(Program, KeepsTheOldFilesWhenTheDiskIsFull) {
  const auto map = out / "map";
  const std::vector<std::string> arguments{"reconstruct", "--no-texture", sequence(), "-o",
                                           map.string(),  "--frames",     "0:5",      "--overwrite"};
  ASSERT_EQ(run_cairn(arguments).exit_code, 0);
  const std::string mesh = read_bytes(map / "mesh.glb"), grids = read_bytes(map / "map.vdb");
  // A file size limit acts as a full disk: first too small for the mesh, then for the map alone.
  for (const std::size_t limit : {mesh.size() / 2, grids.size() / 2}) {
    const Ran ran = run_cairn(arguments, with_files_of(limit));
    EXPECT_EQ(ran.exit_code, 1);
    EXPECT_NE(ran.err.find("cannot write"), std::string::npos) << ran.err;
    EXPECT_EQ(read_bytes(map / "mesh.glb") == mesh, true);
    EXPECT_EQ(read_bytes(map / "map.vdb") == grids, true);
    for (const auto& entry : fs::recursive_directory_iterator(map))  // no partial file is left
      EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
  }
}

TEST_F(Program, ReportsUnreadableFramesInOneLineAndContinues) {
  const auto copy = out / "copy";
  fs::copy(sequence(), copy, fs::copy_options::recursive);
  std::vector<fs::path> depth(fs::directory_iterator(copy / "depth"), {});
  std::sort(depth.begin(), depth.end());
  for (const int bad : {5, 7})
    fs::resize_file(depth[static_cast<std::size_t>(bad)], fs::file_size(depth[static_cast<std::size_t>(bad)]) / 2);
  const Ran ran = run_cairn(
      {"reconstruct", "--no-texture", copy.string(), "-o", (out / "map").string(), "--frames", "0:10", "--json"});
  const auto report = json_of(ran);
  EXPECT_EQ(report["frames"]["skipped"], 2);
  EXPECT_EQ(report["frames"]["fused"], 8);
  const std::string line = "2 of 10 frames skipped: the file is cut off (first: frame 5, " + depth[5].string() + ")";
  EXPECT_NE(ran.err.find(line), std::string::npos) << ran.err;
  EXPECT_EQ(ran.err.find("cut off"), ran.err.rfind("cut off")) << ran.err;
  EXPECT_NE(std::find(report["warnings"].begin(), report["warnings"].end(), line), report["warnings"].end());
}

TEST_F(Program, ReportsBadInputInOneLine) {
  const auto map = (out / "map").string();
  expect_one_line(run_cairn({"reconstruct", "--no-texture", (out / "nowhere").string(), "-o", map}), 1,
                  "no such folder");
  fs::create_directories(out / "odd");
  expect_one_line(run_cairn({"reconstruct", "--no-texture", (out / "odd").string(), "-o", map}), 1,
                  "is not a known recording");
  expect_one_line(run_cairn({"reconstruct", "--no-texture", "synthetic:castle", "-o", map}), 1, "choose room");
  expect_one_line(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", "/proc/nowhere/map"}), 1,
                  "/proc/nowhere/map");
  expect_one_line(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--voxel-size", "-1"}), 2,
                  "--voxel-size -1: number expected");
  expect_one_line(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--device", "63"}), 1,
                  "cairn devices");
  expect_one_line(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--device-memory", "1"}), 1,
                  "too little");
  expect_one_line(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map},
                            "VK_ICD_FILENAMES=/nowhere VK_DRIVER_FILES=/nowhere"),
                  1, "no Vulkan device");
  write_text(out / "o.yaml", "fuse:\n  voxel_sise: 1\n");
  expect_one_line(
      run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--config", (out / "o.yaml").string()}), 1,
      "o.yaml:2");
  write_text(out / "nan.txt", "0 0 0 nan 0 0 0 1\n");
  expect_one_line(
      run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--poses", (out / "nan.txt").string()}), 1,
      "nan.txt:1");
  expect_one_line(run_cairn({"synth", "room", "-o", sequence() + "/depth"}), 1, "choose another folder");
  EXPECT_FALSE(fs::exists(map + "/mesh.glb"));
}

TEST_F(Program, ExitsWithCode2ForWrongUsage) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"dance"},
        {"reconstruct"},
        {"reconstruct", "--no-texture", sequence(), "-o", "x", "--frames", "5:2"},
        {"reconstruct", "--no-texture", sequence(), "-o", "x", "--voxel-size", "big"},
        {"reconstruct", "--no-texture", sequence(), "x", "-o", "y"},
        {"synth", "room", "-o", "x", "--noise", "loud"}}) {
    const Ran ran = run_cairn(arguments);
    EXPECT_EQ(ran.exit_code, 2) << ran.err;
    EXPECT_FALSE(ran.err.empty());
  }
  EXPECT_EQ(run_cairn({"--help"}).exit_code, 0);
  EXPECT_EQ(run_cairn({"reconstruct", "--no-texture", "--help"}).exit_code, 0);
}

TEST_F(Program, ReintegratesWithAdjustedKeyframes) {
  const auto map = (out / "map").string();
  const auto report =
      json_of(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--reintegrate", "--json"}));
  EXPECT_EQ(report["frames"]["fused"], 40);
  EXPECT_GT(report["adjusted"]["keyframes"], 1);
  EXPECT_EQ(validate_gltf(map + "/mesh.glb"), "");
  EXPECT_TRUE(fs::exists(map + "/graph.g2o"));
  const auto error = json_of(
      run_cairn({"evaluate", "trajectory", map + "/trajectory.txt", sequence() + "/groundtruth.txt", "--json"}));
  EXPECT_LT(error["ate_m"]["rmse"], 0.002);
  EXPECT_EQ(error["matched_poses"], 40);
}

TEST_F(Program, OptimizesAGraph) {
  const auto file = (out / "chain.g2o").string(), moved = (out / "moved.g2o").string();
  const std::string information = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  std::ofstream(file) << "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 5 5 5 0 0 0 1\n"
                      << "EDGE_SE3:QUAT 0 1 1 2 3 0 0 0 1" << information;
  const auto report = json_of(run_cairn({"graph", "optimize", file, "-o", moved, "--json"}));
  EXPECT_NEAR(report["cost"].get<double>(), 0, 1e-9);
  EXPECT_EQ(report["components"], 1);
  std::ofstream(file, std::ios::app) << "EDGE_SE3:QUAT 0 9 1 2 3 0 0 0 1" << information;
  expect_one_line(run_cairn({"graph", "optimize", file, "-o", moved}), 1, "chain.g2o:4: unknown node 9");
}

TEST_F(Program, AlignsTheMapWithGravityByTheAccelerometer) {
  const fs::path map = map_of_sequence();
  const auto report = nlohmann::json::parse(read_bytes(map / "report.json"));
  const auto found = read_trajectory(map / "trajectory.txt"),
             truth = read_trajectory(fs::path(sequence()) / "groundtruth.txt");
  // Both worlds have y down; the first true camera is pitched down by a third of a radian.
  const Eigen::Matrix3d found_from_truth =
      found.front().world_from_camera.linear() * truth.front().world_from_camera.linear().transpose();
  // The hand's acceleration tilts the first measurement; the mean over the run provides the tilt.
  const double tilt = std::acos(found_from_truth.col(1).y());
  EXPECT_LT(tilt, 0.06);
  EXPECT_GT(std::acos(truth.front().world_from_camera.linear().col(1).y()), 0.1);
  EXPECT_NEAR(report["tilt_degrees"].get<double>() * std::numbers::pi / 180, tilt, 0.025);
}

TEST_F(Program, EstimatesTheColorClockOffset) {
  const auto late = (out / "late").string(), map = (out / "map").string();
  ASSERT_EQ(run_cairn({"synth", "room", "-o", late, "--frames", "40", "--color-delay", "0.02"}).exit_code, 0);
  const auto report = json_of(run_cairn({"reconstruct", "--no-texture", late, "-o", map, "--json"}));
  // Images are taken later than their stamps: the clock is behind.
  EXPECT_NEAR(report["clock_offset"].get<double>(), -0.02, 0.008);
  const auto without = nlohmann::json::parse(read_bytes(map_of_sequence() / "report.json"));
  EXPECT_NEAR(without["clock_offset"].get<double>(), 0.0, 0.003);
}

TEST_F(Program, WarnsOfAWrongFocalLength) {
  const fs::path turning = out / "turning";
  ASSERT_EQ(run_cairn({"synth", "room", "-o", turning.string(), "--frames", "110"}).exit_code, 0);
  const std::vector<std::string> arguments{
      "reconstruct", "--no-texture", turning.string(), "-o",   (out / "map").string(),
      "--frames",    "0:110:2",      "--voxel-size",   "0.02", "--overwrite"};
  const Ran silent = run_cairn(arguments);
  EXPECT_EQ(silent.out.find("intrinsics"), std::string::npos) << silent.out;
  std::ofstream(turning / "camera.yaml") << "{width: 640, height: 480, fx: 578, fy: 578, cx: 319.5, cy: 239.5}";
  const Ran warned = run_cairn(arguments);
  EXPECT_EQ(warned.exit_code, 0) << warned.err;
  EXPECT_NE(warned.out.find("check the camera's intrinsics"), std::string::npos) << warned.out;
}

struct Recorded {
  const char* name;
  const char* frames;
  const char* truth;  // file; empty: the recording's own poses
  double ate;         // meters, over the part read here
};

class Recording : public testing::TestWithParam<Recorded> {};

TEST_P(Recording, IsTrackedWithoutLoss) {
  CAIRN_REQUIRE_DATA(GetParam().name);
  const TemporaryFolder out;
  const auto folder = (data_folder() / GetParam().name).string();
  const auto report = json_of(run_cairn(
      {"reconstruct", "--no-texture", folder, "-o", (out / "map").string(), "--frames", GetParam().frames, "--json"}));
  EXPECT_EQ(report["frames"]["fused"], report["frames"]["total"]);
  const auto error = json_of(run_cairn({"evaluate", "trajectory", (out / "map" / "trajectory.txt").string(),
                                        (fs::path(folder) / GetParam().truth).string(), "--json"}));
  EXPECT_LT(error["ate_m"]["rmse"], GetParam().ate);
  EXPECT_EQ(validate_gltf(out / "map" / "mesh.glb"), "");
}

INSTANTIATE_TEST_SUITE_P(Real, Recording,
                         testing::Values(Recorded{"tum_fr1_rpy_400", "0:400:2", "", 0.02},
                                         Recorded{"7scenes_redkitchen_600", "0:300:2", "groundtruth_sfm.txt", 0.015},
                                         Recorded{"icl_office_kt0_101", "0:101:2", "", 0.004}),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

TEST_F(Program, ComputesDistancesToTheNearestSurface) {
  const std::string exact = Program::exact(), map = (out / "map").string();
  const auto report = json_of(run_cairn(
      {"reconstruct", "--no-texture", exact, "-o", map, "--poses", exact + "/groundtruth.txt", "--esdf", "--json"}));
  EXPECT_EQ(report["stages"]["esdf"]["count"], 30);
  const auto error = json_of(run_cairn(
      {"evaluate", "distances", map + "/map.vdb", "room", "--seen", exact + "/groundtruth_seen.ply", "--json"}));
  EXPECT_LT(error["distance_m"]["mean"], 0.3 * 0.02);
  EXPECT_GT(error["within_voxel"], 0.98);
  EXPECT_LT(error["gradient_mean_rad"], 3 * std::numbers::pi / 180);
  EXPECT_GT(error["right_signs"], 0.999);
  EXPECT_GT(error["distance_m"]["count"], 100000);

  // The field written by reconstruct beside the TSDF equals the output of `cairn esdf`.
  ASSERT_EQ(run_cairn({"esdf", map, "-o", (out / "esdf.vdb").string()}).exit_code, 0);
  const DistanceField written = DistanceField::read(map + "/map.vdb"), made = DistanceField::read(out / "esdf.vdb");
  const Scene scene = synthetic_scene("room");
  std::string csv = "x,y,z\n";
  int known = 0;
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 400; ++i) {
    points.emplace_back(0.011f * static_cast<float>(i % 200), 0.3f, 2.0f - 0.005f * static_cast<float>(i));
    const auto a = written.query(points.back()), b = made.query(points.back());
    EXPECT_EQ(a.known, b.known);
    EXPECT_EQ(a.distance, b.distance);
    known += a.known;
    csv += std::to_string(points.back().x()) + ",0.3," + std::to_string(points.back().z()) + "\n";
  }
  EXPECT_GT(known, 100);
  write_text(out / "points.csv", csv + "nan,0,0\n1e9,0,0\n");
  const Ran ran =
      run_cairn({"esdf", map, "--query", (out / "points.csv").string(), "-o", (out / "answers.csv").string()});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  std::ifstream answers(out / "answers.csv");
  std::string line;
  std::getline(answers, line);
  EXPECT_EQ(line, "x,y,z,distance,gx,gy,gz,state");
  int lines = 0, known_lines = 0;
  while (std::getline(answers, line)) {
    ++lines;
    known_lines += line.ends_with(",known");
    EXPECT_TRUE(line.ends_with(",known") || line.ends_with(",,,,,unknown")) << line;
  }
  EXPECT_EQ(lines, 402);
  EXPECT_EQ(known_lines, known);
}

TEST_F(Program, MarksTheCameraPathAsFree) {
  const std::string map = (out / "map").string();
  ASSERT_EQ(run_cairn({"reconstruct", sequence(), "-o", map, "--voxel-size", "0.02"}).exit_code, 0);
  std::string csv = "x,y,z\n", aside = csv;
  const Trajectory path = read_trajectory(map + "/trajectory.txt");
  for (const StampedPose& pose : path) {
    const auto line = [](const Eigen::Vector3d& p) {
      return std::to_string(p.x()) + "," + std::to_string(p.y()) + "," + std::to_string(p.z()) + "\n";
    };
    csv += line(pose.world_from_camera.translation());
    aside += line(pose.world_from_camera * Eigen::Vector3d(0, 0, -0.3));  // behind the camera
  }
  write_text(out / "path.csv", csv);
  write_text(out / "aside.csv", aside);
  const auto known = [&](const std::string& vdb, const char* points, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {
        "esdf", vdb, "--query", (out / points).string(), "--json", "-o", (out / "answers.csv").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return json_of(run_cairn(arguments))["known_points"].get<std::size_t>();
  };
  ASSERT_GT(path.size(), 10u);
  EXPECT_EQ(known(map, "path.csv"), path.size());
  EXPECT_LT(known(map, "aside.csv"), path.size());
  EXPECT_EQ(known(map, "aside.csv", {"--robot-radius", "0.4"}), path.size());
  // The same holds for the map file alone, and for the map exported from its session.
  fs::create_directories(out / "alone");
  fs::copy(map + "/map.vdb", out / "alone" / "map.vdb");
  EXPECT_EQ(known((out / "alone").string(), "path.csv"), path.size());
  ASSERT_EQ(run_cairn({"export", map, "-o", (out / "alone" / "again.vdb").string()}).exit_code, 0);
  EXPECT_EQ(known((out / "alone" / "again.vdb").string(), "path.csv"), path.size());
  const Ran ran = run_cairn({"esdf", (out / "alone").string(), "--robot-radius", "0.4"});
  EXPECT_EQ(ran.exit_code, 1);
  EXPECT_NE(ran.err.find("trajectory.txt: is missing"), std::string::npos) << ran.err;
}

TEST_F(Program, DrawsSlicesAndCostmaps) {
  const auto map = (out / "map").string();
  ASSERT_EQ(
      run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--poses", sequence() + "/groundtruth.txt"})
          .exit_code,
      0);
  const Ran ran = run_cairn({"esdf", map, "--slice", "y=0.2", (out / "slice.png").string(), "--costmap",
                             (out / "floor.yaml").string(), "--height", "-1.0:0.4", "--json"});
  const auto result = json_of(ran);
  const cv::Mat slice = cv::imread((out / "slice.png").string());
  ASSERT_FALSE(slice.empty());
  EXPECT_GT(slice.cols, 900);
  std::ifstream yaml(out / "floor.yaml");
  std::string text(std::istreambuf_iterator<char>(yaml), {});
  for (const char* part : {"image: floor.pgm\n", "resolution: 0.02\n", "origin: [", "negate: 0\n", "occupied_thresh:"})
    EXPECT_NE(text.find(part), std::string::npos) << part;
  const cv::Mat costmap = cv::imread((out / "floor.pgm").string(), cv::IMREAD_UNCHANGED);
  ASSERT_FALSE(costmap.empty());
  EXPECT_NEAR(costmap.cols, (result["high"][2].get<double>() - result["low"][2].get<double>()) / 0.02, 2);
  EXPECT_NEAR(costmap.rows, (result["high"][0].get<double>() - result["low"][0].get<double>()) / 0.02, 2);
  for (const int value : {0, 254, 205}) EXPECT_GT(cv::countNonZero(costmap == value), 500) << value;
  EXPECT_EQ(cv::countNonZero(costmap == 0) + cv::countNonZero(costmap == 254) + cv::countNonZero(costmap == 205),
            costmap.rows * costmap.cols);
  // No free cell contains surface, except for borders smoothed by the mesh.
  const auto at = text.find("origin: [");
  const double x = std::stod(text.substr(at + 9)), y = std::stod(text.substr(text.find(',', at) + 1));
  int passed = 0, wrong = 0;
  for (const Eigen::Vector3f& p : read_mesh(out / "map" / "mesh.glb").positions) {
    if (-p.y() < -1.0f || -p.y() > 0.4f) continue;
    const auto column = static_cast<int>(std::floor((static_cast<double>(p.z()) - x) / 0.02)),
               row = costmap.rows - 1 - static_cast<int>(std::floor((static_cast<double>(-p.x()) - y) / 0.02));
    ++passed;
    wrong += row >= 0 && row < costmap.rows && column >= 0 && column < costmap.cols &&
             costmap.at<std::uint8_t>(row, column) == 254;
  }
  EXPECT_GT(passed, 10000);
  EXPECT_LT(wrong, passed / 500);
}

TEST_F(Program, ReportsWrongDistanceQueries) {
  const auto map = (out / "map").string(), csv = (out / "points.csv").string();
  ASSERT_EQ(run_cairn({"reconstruct", "--no-texture", sequence(), "-o", map, "--frames", "0:3", "--voxel-size", "0.02",
                       "--poses", sequence() + "/groundtruth.txt"})
                .exit_code,
            0);
  const auto refused = [&](std::vector<std::string> arguments, const std::string& expected, int exit_code = 1) {
    arguments.insert(arguments.begin(), "esdf");
    const Ran ran = run_cairn(arguments);
    EXPECT_EQ(ran.exit_code, exit_code) << expected;
    EXPECT_NE(ran.err.find(expected), std::string::npos) << ran.err;
  };
  for (const auto& [text, expected] : {std::pair{"x,y,z\n1,2,3\n1,2\n", ":3: has 2 columns"},
                                       {"x,y,z\n1,2,foo\n", ":2: 'foo' is not a number"},
                                       {"x,y\n1,2\n", ":1: expected the header x,y,z"},
                                       {"", ":1: is empty"}}) {
    write_text(csv, text);
    refused({map, "--query", csv}, expected);
  }
  refused({map, "--max-distance", "-1"}, "--max-distance -1: number expected", 2);
  refused({map, "--max-distance", "1e9"}, "--max-distance 1e9: number expected", 2);
  refused({map, "--esdf-voxel-size", "0.03"}, "choose 1, 2, 4 or 8 times");
  refused({map, "-o", (out / "x.foo").string()}, "unknown kind of file");
  refused({map, "-o", (out / "x.csv").string()}, "give --query");
  refused({map, "-o", (out / "none" / "x.vdb").string()}, "No such file or directory: make the folder first");
  refused({map, "--slice", "y=40", (out / "x.png").string()}, "no data at y = 40");
  refused({map, "--slice", "w=1", (out / "x.png").string()}, "is not a plane", 2);
  refused({map, "--costmap", (out / "x.yaml").string()}, "needs --height", 2);
  refused({map, "--costmap", (out / "x.yaml").string(), "--height", "8:9"}, "no data between 8 and 9 m");
  EXPECT_FALSE(fs::exists(out / "x.vdb"));
  EXPECT_FALSE(fs::exists(out / "x.yaml"));
  // An empty map, and a map without observations.
  write_grids(out / "empty.vdb", {}, {.voxel_size = 0.02f, .truncation = 0.08f});
  refused({(out / "empty.vdb").string()}, "has no surface");
  BrickTree free;
  free.mark_free({1, 2, 3});
  write_grids(out / "free.vdb", free, {.voxel_size = 0.02f, .truncation = 0.08f});
  refused({(out / "free.vdb").string()}, "has no surface");
}

}  // namespace
}  // namespace cairn
