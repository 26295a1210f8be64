// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/run_log.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "cairn/mapping/live_surface.hpp"
#include "support/files.hpp"
#include "support/logs.hpp"
#include "support/scenes.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 40;
constexpr double kStart = 1'700'000'000;  // seconds: typical stamps of a sensor

/// Sum of the positions of all triangles' corners, to compare two surfaces.
Eigen::Vector3d sum_of(const std::vector<SurfaceBlock>& parts) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const SurfaceBlock& part : parts)
    for (const auto& t : part.mesh.triangles)
      for (const auto i : t) sum += part.mesh.positions[i].cast<double>();
  return sum;
}

std::size_t triangles_of(const std::vector<SurfaceBlock>& parts) {
  std::size_t all = 0;
  for (const SurfaceBlock& part : parts) all += part.mesh.triangles.size();
  return all;
}

class LoggedRun : public testing::Test {
 protected:
  /// Some frames of the room, including an unreadable frame and a frame before the first timestamp.
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    const auto source = open_synthetic({.scene = "room", .first = 0, .frames = kFrames});
    Mapper mapper(source->rig());
    RunLog log(*folder / "x.mcap");
    log.begin(mapper, source->rig());
    log.warn("said before the first frame");
    const Frame bad{.index = 0, .timestamp = std::numeric_limits<double>::quiet_NaN(), .problem = "no time"};
    log.add(bad, mapper.add(bad));
    while (auto frame = source->next()) {
      frame->timestamp += kStart;
      if (frame->index == 20) frame->problem = "cut off";
      log.add(*frame, mapper.add(*frame));
    }
    log.finishing();
    (void)mapper.map().mesh();
    mapper.freeze_gravity();
    log.finish({.words = "as it should be", .reasons = {}});
    EXPECT_FALSE(log.problem());
    logged = new nlohmann::json(read_log(*folder / "x.mcap"));
    surface = new std::vector<SurfaceBlock>(parts_of_a_second_run());
    trajectory = new Trajectory(mapper.trajectory());
  }
  static void TearDownTestSuite() {
    delete surface;
    delete trajectory;
    delete logged;
    delete folder;
  }
  static std::vector<SurfaceBlock> parts_of_a_second_run() {
    const auto source = open_synthetic({.scene = "room", .first = 0, .frames = kFrames});
    Mapper mapper(source->rig());
    while (auto frame = source->next()) {
      if (frame->index == 20) frame->problem = "cut off";
      (void)mapper.add(*frame);
    }
    return LiveSurface(mapper).changes(1 << 20, true).parts;
  }
  static TemporaryFolder* folder;
  static nlohmann::json* logged;  // contents as read by MCAP's own readers
  static std::vector<SurfaceBlock>* surface;
  static Trajectory* trajectory;
};
TemporaryFolder* LoggedRun::folder = nullptr;
nlohmann::json* LoggedRun::logged = nullptr;
std::vector<SurfaceBlock>* LoggedRun::surface = nullptr;
Trajectory* LoggedRun::trajectory = nullptr;

TEST_F(LoggedRun, HasEveryTopicByItsSchema) {
  const auto& topics = (*logged)["topics"];
  const std::map<std::string, std::pair<std::string, int>> expected{
      {"/tf", {"foxglove.FrameTransforms", kFrames}},  // one less for the skipped frame, one more at the end
      {"/tf/submaps", {"foxglove.FrameTransforms", 2}},
      {"/camera/color/image", {"foxglove.CompressedImage", 7}},
      {"/camera/color/calibration", {"foxglove.CameraCalibration", 7}},
      {"/camera/depth/image", {"foxglove.RawImage", 7}},
      {"/camera/depth/calibration", {"foxglove.CameraCalibration", 7}},
      {"/points", {"foxglove.PointCloud", 7}},
      {"/mesh", {"foxglove.SceneUpdate", 2}},
      {"/trajectory", {"foxglove.PosesInFrame", 2}},
      {"/diagnostics", {"foxglove.Log", 3}},
      {"/cairn/frame", {"cairn.Frame", kFrames}}};
  EXPECT_EQ(topics.size(), expected.size());
  for (const auto& [topic, schema_and_count] : expected) {
    ASSERT_TRUE(topics.contains(topic)) << topic;
    EXPECT_EQ(topics[topic]["schema"], schema_and_count.first) << topic;
    EXPECT_EQ(topics[topic]["count"], schema_and_count.second) << topic;
  }
  EXPECT_EQ(topics["/camera/depth/image"]["bytes"], 2 * 640 * 480);
  EXPECT_GT(topics["/camera/color/image"]["bytes"], 5000);
  EXPECT_GT(topics["/points"]["bytes"], 10000);
  EXPECT_LE(topics["/points"]["bytes"], 160 * 120);
}

TEST_F(LoggedRun, HasTheTimesOfTheRecording) {
  for (const auto& [name, topic] : (*logged)["topics"].items()) {
    EXPECT_GE(topic["first"].get<double>(), kStart * 1e9) << name;
    EXPECT_LE(topic["last"].get<double>(), (kStart + kFrames / 30.0) * 1e9) << name;
  }
}

TEST_F(LoggedRun, ContainsTheCompleteSurface) {
  const auto& mesh = (*logged)["mesh"];
  const auto triangle_count = static_cast<double>(triangles_of(*surface));
  // Blocks are meshed one after the other, so a few triangles at their borders may be older.
  EXPECT_NEAR(mesh["triangles"].get<double>(), triangle_count, 0.002 * triangle_count);
  const Eigen::Vector3d sum = sum_of(*surface) / triangle_count;
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(mesh["sum"][static_cast<std::size_t>(k)].get<double>() / mesh["triangles"].get<double>(), sum[k], 0.01);
  EXPECT_GT(mesh["color"], 0.5);
  EXPECT_LE(mesh["color"], 1);
}

TEST_F(LoggedRun, ConnectsUprightFramesFromMapToCamera) {
  const auto& frames = (*logged)["frames"];
  EXPECT_EQ(frames["world"]["parent"], "map");
  EXPECT_EQ(frames["tracked"]["parent"], "world");
  EXPECT_EQ(frames["camera"]["parent"], "tracked");
  EXPECT_EQ(frames["camera_color"]["parent"], "camera");
  EXPECT_EQ(frames["submap_0"]["parent"], "tracked");
  const auto& q = frames["world"]["q"];
  const Eigen::Quaterniond turn(q["w"], q["x"], q["y"], q["z"]);
  EXPECT_NEAR((turn * -Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitZ()).norm(), 0, 1e-12);  // up
  EXPECT_NEAR((turn * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm(), 0, 1e-12);   // forward
  const auto& last = (*logged)["trajectory"];
  EXPECT_EQ(last["frame"], "world");
  ASSERT_EQ(last["poses"].size(), trajectory->size());
  for (std::size_t i = 0; i < trajectory->size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_DOUBLE_EQ(last["poses"][i][k].get<double>(),
                       (*trajectory)[i].world_from_camera.translation()[static_cast<Eigen::Index>(k)]);
}

TEST_F(LoggedRun, LogsStateChangesAndWarnings) {
  const auto& texts = (*logged)["texts"];
  ASSERT_EQ(texts.size(), 3u) << texts;
  EXPECT_EQ(texts[0], "WARNING said before the first frame");
  EXPECT_EQ(texts[1], "WARNING frame 20 is skipped: cut off");
  EXPECT_EQ(texts[2], "INFO good: as it should be");
  EXPECT_EQ((*logged)["states"][20], "SKIPPED");
  EXPECT_EQ((*logged)["states"][21], "FUSED");
}

TEST_F(LoggedRun, IsNoRecording) {
  const std::string error = error_of([] { (void)open_source((*folder / "x.mcap").string()); });
  EXPECT_EQ(error,
            (*folder / "x.mcap").string() + ": is a log of a run (--log), not a recording; Foxglove and Rerun play it");
}

TEST(RunLog, RejectsInvalidNames) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] { RunLog(folder / "x.bag"); }).find("give it a name that ends in .mcap"), std::string::npos);
  write_text(folder / "x.mcap", "somebody's");
  EXPECT_NE(error_of([&] { RunLog(folder / "x.mcap"); }).find("exists; choose another name"), std::string::npos);
  EXPECT_EQ(read_bytes(folder / "x.mcap"), "somebody's");
  EXPECT_NE(error_of([&] { RunLog(folder / "x.mcap", true); }).find("is not a log of an earlier run"),
            std::string::npos);
  EXPECT_EQ(read_bytes(folder / "x.mcap"), "somebody's");
  EXPECT_NO_THROW(RunLog(folder / "y.mcap"));
  EXPECT_NO_THROW(RunLog(folder / "y.mcap", true));
  EXPECT_NE(error_of([&] { RunLog(folder / "none" / "x.mcap"); }).find("make the folder first"), std::string::npos);
}

TEST(RunLog, RestartsWithAnotherMap) {
  const TemporaryFolder folder;
  const auto source = open_synthetic({.scene = "room", .first = 0, .frames = 6});
  std::optional<Mapper> mapper;
  RunLog log(folder / "x.mcap");
  for (int i = 0; auto frame = source->next(); ++i) {
    if (i % 3 == 0) {
      mapper.reset();
      mapper.emplace(source->rig());
      log.begin(*mapper, source->rig());
    }
    log.add(*frame, mapper->add(*frame));
  }
  log.finish({.words = "well", .reasons = {}});
  EXPECT_EQ(read_log(folder / "x.mcap")["mesh"]["entities"], 0);  // until the next update of the surface
}

}  // namespace
}  // namespace cairn
