// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gravity direction of all outputs, or a warning if it is unknown.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "cairn/mapping/map.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr double kDegree = std::numbers::pi / 180;

class UprightMap : public testing::Test {
 protected:
  [[nodiscard]] std::string to(const std::string& name) const { return (out / name).string(); }
  [[nodiscard]] static nlohmann::json report_of(const fs::path& map) {
    return nlohmann::json::parse(read_bytes(map / "report.json"));
  }
  /// Arguments to reconstruct a small recording, plus more.
  [[nodiscard]] std::vector<std::string> reconstruct(const std::string& recording, const std::string& map,
                                                     const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{"reconstruct", to(recording), "-o",
                                       to(map),       "--config",    to(recording + ".yaml")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  TemporaryFolder out;
};

/// Angle in radians between the true world's down and the map's.
double tilt(const fs::path& trajectory, const Scene& scene) {
  const Eigen::Matrix3d first = read_trajectory(trajectory).front().world_from_camera.linear();
  return std::acos(std::min(1.0, (first * scene.world_from_camera(0).linear().transpose()).col(1).y()));
}

TEST_F(UprightMap, IsAlignedByFloorAndWallsWithoutAccelerometer) {
  write_small_recording(out / "room", {.frames = 40});
  const Ran ran = run_cairn(reconstruct("room", "map"));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("upright     estimated from floors and walls"), std::string::npos) << ran.out;
  const auto upright = report_of(out / "map")["upright"];
  EXPECT_EQ(upright["source"], "structure");
  EXPECT_EQ(upright["known"], true);
  const Scene scene = synthetic_scene("room");
  const double held = std::acos(scene.world_from_camera(0).linear().col(1).y());
  EXPECT_NEAR(upright["turned_degrees"].get<double>() * kDegree, held, 0.5 * kDegree);
  EXPECT_LT(tilt(out / "map" / "trajectory.txt", scene), 0.5 * kDegree);
  EXPECT_GT(held, 5 * kDegree);  // else the test would be meaningless

  // Files of the session and the grids have the trajectory's frame.
  ASSERT_EQ(run_cairn({"export", to("map"), "-o", to("mesh.ply")}).exit_code, 0);
  const Mesh from_session = read_mesh(out / "mesh.ply"), from_run = read_mesh(out / "map" / "mesh.glb");
  const auto box = [](const Mesh& mesh) {
    Eigen::AlignedBox3f all;
    for (const auto& p : mesh.positions) all.extend(p);
    return all;
  };
  EXPECT_LT((box(from_session).min() - box(from_run).min()).norm(), 1e-3f);
  EXPECT_LT((box(from_session).max() - box(from_run).max()).norm(), 1e-3f);
  const Eigen::Isometry3d scene_from_map =
      scene.world_from_camera(0) * read_trajectory(out / "map" / "trajectory.txt").front().world_from_camera.inverse();
  const Mesh from_grids = Map::open(out / "map" / "map.vdb").mesh();
  std::size_t near = 0;
  for (const auto& p : from_grids.positions) near += std::abs(scene.distance(scene_from_map * p.cast<double>())) < 0.03;
  EXPECT_GT(static_cast<double>(near), 0.9 * static_cast<double>(from_grids.positions.size()));

  // A frozen direction stays, also after a resume.
  const std::string trajectory = read_bytes(out / "map" / "trajectory.txt"),
                    grids = read_bytes(out / "map" / "map.vdb");
  ASSERT_EQ(run_cairn(reconstruct("room", "map", {"--resume"})).exit_code, 0);
  EXPECT_EQ(read_bytes(out / "map" / "trajectory.txt"), trajectory);
  EXPECT_TRUE(read_bytes(out / "map" / "map.vdb") == grids);

  // An explicit option overrides it.
  ASSERT_EQ(run_cairn(reconstruct("room", "map", {"--resume", "--up", "camera"})).exit_code, 0);
  EXPECT_EQ(report_of(out / "map")["upright"]["source"], "option");
  const Eigen::Isometry3d first = read_trajectory(out / "map" / "trajectory.txt").front().world_from_camera;
  EXPECT_TRUE(first.isApprox(Eigen::Isometry3d::Identity(), 1e-6));
  ASSERT_EQ(run_cairn(reconstruct("room", "map", {"--resume", "--up=-z"})).exit_code, 0);
  const Eigen::Isometry3d rotated = read_trajectory(out / "map" / "trajectory.txt").front().world_from_camera;
  EXPECT_LT((rotated.linear() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm(), 1e-6);
}

TEST_F(UprightMap, ReportsUnknownGravityOfAPlane) {
  write_small_recording(out / "plane", {.frames = 12, .scene = "plane"});
  const Ran ran = run_cairn(reconstruct("plane", "map"));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("upright     unknown"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("--up"), std::string::npos) << ran.out;
  const auto upright = report_of(out / "map")["upright"];
  EXPECT_EQ(upright["source"], "unknown");
  EXPECT_EQ(upright["known"], false);
  EXPECT_EQ(upright["turned_degrees"], 0);
  EXPECT_NE(read_bytes(out / "map" / "mesh.glb").find("\"up_axis\":\"unknown\""), std::string::npos);
  const Ran cut = run_cairn({"esdf", to("map"), "--costmap", to("map.yaml"), "--height", "-0.5:0.5"});
  EXPECT_EQ(cut.exit_code, 0) << cut.err;
  EXPECT_NE(cut.err.find("the gravity direction is unknown"), std::string::npos) << cut.err;
  EXPECT_NE(cut.err.find("--up"), std::string::npos) << cut.err;
}

TEST_F(UprightMap, RefusesAnInvalidUpAxis) {
  const Ran ran = run_cairn({"reconstruct", "synthetic:room", "-o", to("map"), "--up", "sideways"});
  EXPECT_EQ(ran.exit_code, 2);
  EXPECT_NE(ran.err.find("camera"), std::string::npos) << ran.err;
}

/// Costmap as read by map_server.
struct Costmap {
  Costmap(const fs::path& yaml) {
    std::istringstream lines(read_bytes(yaml));
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with("resolution:")) resolution = std::stod(line.substr(11));
      if (line.starts_with("origin:")) std::sscanf(line.c_str(), "origin: [%lf, %lf", &x, &y);
    }
    fs::path pgm = yaml;
    const std::string bytes = read_bytes(pgm.replace_extension(".pgm"));
    std::istringstream in(bytes);
    std::string magic;
    int most = 0;
    in >> magic >> columns >> rows >> most;
    in.get();
    cells = bytes.substr(static_cast<std::size_t>(in.tellg()));
  }
  /// 0, 205 or 254 at a position in meters; 205 outside.
  [[nodiscard]] int at(double px, double py) const {
    const int column = static_cast<int>(std::floor((px - x) / resolution)),
              row = rows - 1 - static_cast<int>(std::floor((py - y) / resolution));
    if (column < 0 || row < 0 || column >= columns || row >= rows) return 205;
    return static_cast<unsigned char>(cells[static_cast<std::size_t>(row * columns + column)]);
  }
  double resolution = 0, x = 0, y = 0;
  int columns = 0, rows = 0;
  std::string cells;
};

TEST_F(UprightMap, OfGivenPosesIsTheSameIfAlignedAtExport) {
  constexpr int kFrames = 30;
  const Scene scene = synthetic_scene("room");
  write_small_recording(out / "room", {.frames = kFrames, .speed = 3});
  Eigen::Isometry3d z_up = Eigen::Isometry3d::Identity();
  z_up.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  Trajectory poses;
  for (int i = 0; i < kFrames; ++i) poses.push_back({i / 30.0, z_up * scene.world_from_camera(3 * i / 30.0)});
  write_trajectory(out / "poses.txt", poses);
  const Ran unaligned = run_cairn(reconstruct("room", "unaligned", {"--poses", to("poses.txt")}));
  ASSERT_EQ(unaligned.exit_code, 0) << unaligned.err;
  EXPECT_NE(unaligned.out.find("--up z"), std::string::npos) << unaligned.out;
  EXPECT_NE(read_bytes(out / "unaligned" / "mesh.glb").find("\"up_axis\":\"unknown\""), std::string::npos);
  ASSERT_EQ(run_cairn(reconstruct("room", "aligned", {"--poses", to("poses.txt"), "--up", "z"})).exit_code, 0);

  const auto exported = [&](const std::string& map, const std::vector<std::string>& more) {
    const auto run = [&](std::vector<std::string> arguments) {
      arguments.insert(arguments.end(), more.begin(), more.end());
      const Ran ran = run_cairn(arguments);
      EXPECT_EQ(ran.exit_code, 0) << ran.err;
      EXPECT_EQ(ran.err.find("askew"), std::string::npos) << ran.err;
    };
    run({"export", to(map + "/map.vdb"), "-o", to(map + ".glb"), "--no-texture"});
    run({"esdf", to(map), "--costmap", to(map + ".yaml"), "--height", "-0.8:0.4"});
    return std::pair(read_mesh(out / (map + ".glb")), read_bytes(out / (map + ".pgm")));
  };
  const auto [at_export, costmap_at_export] = exported("unaligned", {"--up", "z"});
  const auto [before, costmap_before] = exported("aligned", {});
  ASSERT_EQ(at_export.positions.size(), before.positions.size());
  float distance = 0;
  for (std::size_t i = 0; i < before.positions.size(); ++i)
    distance = std::max(distance, (at_export.positions[i] - before.positions[i]).norm());
  EXPECT_LT(distance, 1e-4f);  // meters
  EXPECT_TRUE(costmap_at_export == costmap_before);

  const Ran asked = run_cairn({"export", to("unaligned/map.vdb"), "-o", to("x.glb"), "--up", "auto"});
  EXPECT_EQ(asked.exit_code, 1);
  EXPECT_NE(asked.err.find("give the axis that points up"), std::string::npos) << asked.err;
}

TEST_F(UprightMap, OfATiltedFlatHasTheCostmapOfTheUprightOne) {
  constexpr int kFrames = 60;
  const Scene scene = synthetic_scene("flat");
  write_small_recording(out / "flat", {.frames = kFrames, .speed = 3, .scene = "flat"});
  const Eigen::Isometry3d tilt{Eigen::AngleAxisd(29 * kDegree, Eigen::Vector3d(1, 0, 0.4).normalized())};
  Trajectory upright, tilted;
  for (int i = 0; i < kFrames; ++i) {
    upright.push_back({i / 30.0, scene.world_from_camera(3 * i / 30.0)});
    tilted.push_back({i / 30.0, tilt * scene.world_from_camera(3 * i / 30.0)});
  }
  write_trajectory(out / "upright.txt", upright);
  write_trajectory(out / "tilted.txt", tilted);
  const auto costmap_of = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = reconstruct("flat", name, {"--poses", to(name + ".txt")});
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Ran ran = run_cairn(arguments);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    const Ran cut = run_cairn({"esdf", to(name), "--costmap", to(name + ".yaml"), "--height", "-0.8:0.4"});
    EXPECT_EQ(cut.exit_code, 0) << cut.err;
    EXPECT_EQ(cut.err.find("askew"), std::string::npos) << cut.err;
    return Costmap(out / (name + ".yaml"));
  };
  const Costmap a = costmap_of("upright", {}), b = costmap_of("tilted", {"--up", "auto"});
  EXPECT_EQ(report_of(out / "upright")["upright"]["source"], "poses");
  EXPECT_EQ(report_of(out / "upright")["upright"]["known"], true);
  EXPECT_NEAR(report_of(out / "tilted")["upright"]["turned_degrees"].get<double>(), 29, 0.5);
  int known = 0, same = 0, contradicted = 0;
  for (int row = 0; row < a.rows; ++row)
    for (int column = 0; column < a.columns; ++column) {
      const double x = a.x + (column + 0.5) * a.resolution, y = a.y + (row + 0.5) * a.resolution;
      const int in_a = a.at(x, y);
      if (in_a == 205) continue;
      ++known;
      bool is_same = false, is_unknown = false;  // within a cell: the grids are offset
      for (const double dx : {-1.0, 0.0, 1.0})
        for (const double dy : {-1.0, 0.0, 1.0}) {
          const int in_b = b.at(x + dx * a.resolution, y + dy * a.resolution);
          is_same = is_same || in_b == in_a;
          is_unknown = is_unknown || in_b == 205;
        }
      same += is_same;
      contradicted += !is_same && !is_unknown;
    }
  EXPECT_GT(known, 500);
  // At the threshold of a half-known band, other voxels may fall on either side; no free cell becomes occupied.
  EXPECT_GT(same, 0.9 * known);
  EXPECT_LT(contradicted, 0.01 * known);
}

}  // namespace
}  // namespace cairn
