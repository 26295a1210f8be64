// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// All outputs of a map rotated upright have the same world frame.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "cairn/mapping/mapper.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr float kVoxel = 0.02f;
constexpr double kLevel = 0.5 * std::numbers::pi / 180;  // required accuracy for a room without an accelerometer

/// Room mapped with given poses in a tilted world.
class TiltedRoom : public testing::Test {
 protected:
  void SetUp() override {
    Options options;
    options.fuse = {.voxel_size = kVoxel, .truncation = 4 * kVoxel, .device_memory = std::uint64_t{96} << 20};
    options.keep_keyframes = true;
    options.up = Up::automatic;
    mapper.emplace(camera, options, Poses::given);
    for (int i = 0; i < 8; ++i) {
      Frame frame = scene_frame(scene, camera, 12 * i);
      poses.push_back(*frame.world_from_camera);
      frame.world_from_camera = tilt * *frame.world_from_camera;
      ASSERT_EQ(mapper->add(frame).state, FrameState::fused);
    }
    upright = mapper->upright();
    scene_from_world = (Eigen::Isometry3d(upright.world_from_tracked) * tilt).inverse();
  }
  /// Distance in meters between a point of the written world and the scene's surface.
  [[nodiscard]] double distance(const Eigen::Vector3f& p) const {
    return scene.distance(scene_from_world * p.cast<double>());
  }
  void expect_on_surface(const Mesh& mesh) const {
    ASSERT_GT(mesh.positions.size(), 1000u);
    std::size_t near = 0;
    for (const auto& p : mesh.positions) near += std::abs(distance(p)) < static_cast<double>(kVoxel);
    EXPECT_GT(static_cast<double>(near), 0.95 * static_cast<double>(mesh.positions.size()));
  }

  const Scene scene = synthetic_scene("room");
  const Camera camera = small_camera();
  const Eigen::Isometry3d tilt{Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 0, 0.3).normalized())};
  std::vector<Eigen::Isometry3d> poses;
  std::optional<Mapper> mapper;
  GravityAlignment upright;
  Eigen::Isometry3d scene_from_world;
  TemporaryFolder out;
};

TEST_F(TiltedRoom, IsGravityAlignedInAllOutputs) {
  EXPECT_EQ(upright.source, GravityAlignment::Source::structure);
  EXPECT_TRUE(upright.known);
  EXPECT_LT(std::acos(scene_from_world.linear().col(1).y()), kLevel);
  EXPECT_NEAR(upright.rotation_angle(), 0.5, kLevel);

  const Trajectory trajectory = mapper->trajectory();
  ASSERT_EQ(trajectory.size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_TRUE((scene_from_world * trajectory[i].world_from_camera).isApprox(poses[i], 1e-9)) << i;

  Map map = mapper->map();
  const Mesh mesh = map.mesh();
  expect_on_surface(mesh);
  std::size_t outwards = 0;  // normals are rotated as well
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f flat = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    outwards += flat.dot(mesh.normals[a]) >= 0;
  }
  EXPECT_GT(static_cast<double>(outwards), 0.98 * static_cast<double>(mesh.triangles.size()));

  map.write_grids(out / "map.vdb");
  Map reread = Map::open(out / "map.vdb");
  EXPECT_TRUE(reread.upright().known);
  EXPECT_EQ(reread.upright().source, GravityAlignment::Source::structure);
  EXPECT_EQ(reread.upright().description, upright.description);
  const Mesh from_grids = reread.mesh();
  ASSERT_EQ(from_grids.positions.size(), mesh.positions.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    ASSERT_LT((from_grids.positions[i] - mesh.positions[i]).norm(), 1e-4f);

  for (const char* name : {"mesh.glb", "mesh.ply", "mesh.obj", "tileset.json"}) map.export_mesh(out / name);
  expect_on_surface(read_mesh(out / "mesh.glb"));
  expect_on_surface(read_mesh(out / "mesh.ply"));
  EXPECT_NE(read_bytes(out / "mesh.glb").find("\"up_axis\":\"y\",\"up_source\":\"structure\""), std::string::npos);
  map.export_mesh(out / "points.ply", {.point_spacing = 0.05f});
  for (const auto& p : read_mesh(out / "points.ply").positions) ASSERT_LT(std::abs(distance(p)), 0.1);
  map.export_mesh(out / "textured.glb", {.texture = {.enabled = true}});
  expect_on_surface(read_mesh(out / "textured.glb"));
}

TEST_F(TiltedRoom, AnswersDistancesInTheGravityAlignedWorld) {
  Map map = mapper->map();
  const auto field = map.distances();
  map.write_grids(out / "map.vdb");
  const auto from_grids = Map::open(out / "map.vdb").distances();
  write_distances(out / "field.vdb", *field);
  const DistanceField read = DistanceField::read(out / "field.vdb");
  int known = 0, right = 0;
  for (const auto& pose : mapper->trajectory())
    for (const double ahead : {0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 2.1}) {
      const Eigen::Vector3f p = (pose.world_from_camera * Eigen::Vector3d(0, 0, ahead)).cast<float>();
      const auto answer = field->query(p);
      for (const auto& other : {from_grids->query(p), read.query(p)}) {
        EXPECT_EQ(other.known, answer.known);
        EXPECT_NEAR(other.distance, answer.distance, 1e-3);
        EXPECT_LT((other.gradient - answer.gradient).norm(), 0.02f);
      }
      if (!answer.known || answer.distance > 1) continue;
      ++known;
      // The surface is down the gradient.
      right += std::abs(distance(p - answer.distance * answer.gradient)) < 0.08;
    }
  EXPECT_GE(known, 8);
  EXPECT_GE(right, known * 3 / 4);  // some nearest surfaces were not seen
  const Eigen::AlignedBox3f box = field->bounds();
  for (const auto& p : map.mesh().positions) ASSERT_LT(box.exteriorDistance(p), 2 * field->voxel_size());
}

TEST_F(TiltedRoom, IsNotRotatedByDefault) {
  Options options;
  options.fuse = {.voxel_size = 2 * kVoxel, .truncation = 8 * kVoxel, .device_memory = std::uint64_t{96} << 20};
  Mapper given(camera, options, Poses::given);
  Frame frame = scene_frame(scene, camera, 0, true);
  frame.world_from_camera = tilt * *frame.world_from_camera;
  ASSERT_EQ(given.add(frame).state, FrameState::fused);
  EXPECT_EQ(given.upright().source, GravityAlignment::Source::poses);
  EXPECT_EQ(given.upright().rotation_angle(), 0);
  EXPECT_TRUE(given.trajectory()[0].world_from_camera.isApprox(*frame.world_from_camera, 1e-12));
}

}  // namespace
}  // namespace cairn
