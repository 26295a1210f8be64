// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Standard deviation of an adjusted map's surface in all output formats.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/session.hpp"
#include "mapper/access.hpp"
#include "mapper/map_state.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 4, kFrameStep = 8;  // of the scene's path
// Meters at 4 m: grows along the map's x, so that each vertex identifies its lookup position.
constexpr double kMiddle = 0.003, kSlope = 0.0005;
constexpr double kMaxError =
    0.002 * kMiddle + 1.5 * kSlope * SurfaceSigma::kCell;  // a float of 8 bits; a cell and a half

double expected(const Eigen::Vector3d& p) { return kMiddle + kSlope * std::clamp(p.x(), -4.0, 4.0); }

class WrittenSigma : public testing::Test {
 protected:
  void SetUp() override {
    Options options;
    options.fuse = {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = std::uint64_t{96} << 20};
    options.up = Up::z;  // the world is rotated
    mapper.emplace(session.mapper(small_camera(), options));
    const Scene scene = synthetic_scene("room");
    for (int i = 0; i < kFrames; ++i)
      ASSERT_EQ(mapper->add(scene_frame(scene, small_camera(), kFrameStep * i)).state, FrameState::fused);
    tracked_from_world = mapper->upright().world_from_tracked.conjugate();
    ASSERT_LT(tracked_from_world.w(), 0.9);
  }
  /// Simulates an adjustment of the map's surface; if `right`, only of its right part.
  void adjust(bool right = false) {
    SurfaceSigma sigma;
    const Mesh mesh = mapper->map().mesh();
    for (const Eigen::Vector3f& p : mesh.positions) {
      const Eigen::Vector3d at = tracked_from_world * p.cast<double>();
      if (!right || at.x() > 0.5) sigma.add(at, expected(at));
    }
    MapperAccess::state(*mapper)->back_end.atlas().surface_sigma = sigma;
  }
  void expect_sigmas(const Mesh& mesh, const std::string& what) const {
    ASSERT_GT(mesh.positions.size(), 100u) << what;
    ASSERT_EQ(mesh.sigmas.size(), mesh.positions.size()) << what;
    double off = 0;
    for (std::size_t v = 0; v < mesh.sigmas.size(); ++v)
      off = std::max(off, std::abs(static_cast<double>(mesh.sigmas[v]) -
                                   expected(tracked_from_world * mesh.positions[v].cast<double>())));
    EXPECT_LT(off, kMaxError) << what;
  }
  TemporaryFolder out;
  Session session = Session::create(out / "session");
  std::optional<Mapper> mapper;
  Eigen::Quaterniond tracked_from_world;
};

TEST_F(WrittenSigma, IsAbsentFromAMapThatWasNotAdjusted) {
  Map map = mapper->map();
  EXPECT_TRUE(map.mesh().sigmas.empty());
  EXPECT_EQ(map.statistics().sigma_median, 0.0f);
  map.export_mesh(out / "a.glb");
  EXPECT_TRUE(read_mesh(out / "a.glb").sigmas.empty());
  map.write_grids(out / "map.vdb");
  EXPECT_TRUE(Map::open(out / "map.vdb").mesh().sigmas.empty());
}

TEST_F(WrittenSigma, SurvivesMeshProcessing) {
  adjust();
  Map map = mapper->map();
  expect_sigmas(map.mesh(), "mesh");
  ExportOptions options{.simplify = {.ratio = 0.3f}, .texture = {.enabled = true}, .cell_size = 1.0f, .levels = 2};
  options.clean.fill_holes = 0.3f;
  for (const Compression c : {Compression::none, Compression::quantized, Compression::meshopt, Compression::draco}) {
    options.compression = c;
    const std::string what = "compression " + std::to_string(static_cast<int>(c));
    const ExportReport exported = map.export_mesh(out / "a.glb", options);
    EXPECT_GT(exported.parts, 3) << what;
    for (const char* name : {"a.glb", "a.lod1.glb"}) {
      EXPECT_EQ(validate_gltf(out / name), "") << what;
      expect_sigmas(read_mesh(out / name), what + name);
    }
  }
  map.export_mesh(out / "a.ply", {.cell_size = 1.0f});
  expect_sigmas(read_mesh(out / "a.ply"), "PLY");
  map.export_mesh(out / "points.ply", {.point_spacing = 0.03f});
  expect_sigmas(read_mesh(out / "points.ply"), "points");
}

TEST_F(WrittenSigma, IsInTiles) {
  adjust();
  const ExportReport exported = mapper->map().export_mesh(out / "tileset.json", {.cell_size = 1.0f});
  ASSERT_GT(exported.tiles, 3);
  for (const fs::path& file : exported.files)
    if (file.extension() == ".glb") {
      EXPECT_FALSE(read_mesh(file).sigmas.empty()) << file;
    }
}

TEST_F(WrittenSigma, IsTheLargestOutsideTheAdjustment) {
  adjust(true);
  mapper->map().export_mesh(out / "a.glb");
  const Mesh mesh = read_mesh(out / "a.glb");
  const float largest = *std::max_element(mesh.sigmas.begin(), mesh.sigmas.end());
  std::size_t unknown = 0;
  for (std::size_t v = 0; v < mesh.sigmas.size(); ++v)
    if ((tracked_from_world * mesh.positions[v].cast<double>()).x() < 0.3) {
      EXPECT_EQ(mesh.sigmas[v], largest);
      ++unknown;
    }
  EXPECT_GT(unknown, 100u);
}

TEST_F(WrittenSigma, IsTheSameInTheSessionAndInMapVdb) {
  adjust();
  Map map = mapper->map();
  map.export_mesh(out / "a.glb");
  map.write_grids(out / "map.vdb");
  session.checkpoint(*mapper);
  EXPECT_EQ(session.problem(), std::nullopt);
  Map again = Map::open(out / "session");
  again.set_up_axis(Up::z);
  again.export_mesh(out / "again.glb");
  EXPECT_EQ(read_bytes(out / "again.glb"), read_bytes(out / "a.glb"));
  EXPECT_EQ(again.statistics().sigma_median, map.statistics().sigma_median);
  EXPECT_EQ(again.statistics().sigma_95, map.statistics().sigma_95);
  EXPECT_GT(map.statistics().sigma_95, map.statistics().sigma_median);
  expect_sigmas(Map::open(out / "map.vdb").mesh(), "map.vdb");
  Map::open(out / "map.vdb").export_mesh(out / "b.glb");
  expect_sigmas(read_mesh(out / "b.glb"), "map.vdb as glTF");
}

TEST(AtlasSigma, IsDiscardedWhenThePoseGraphMovesKeyframes) {
  Atlas atlas;
  atlas.add({.frame = 0});
  atlas.add({.frame = 1, .follows = true});
  atlas.surface_sigma.add({0, 0, 1}, 0.001);
  PoseGraph graph = atlas.graph();
  const OptimizeReport report{.edge_weights = std::vector<double>(graph.edges.size(), 1.0)};
  atlas.update_poses(graph, report);
  EXPECT_FALSE(atlas.surface_sigma.empty());
  graph.world_from_node[1].translation().x() += 0.01;
  atlas.update_poses(graph, report);
  EXPECT_TRUE(atlas.surface_sigma.empty());
}

}  // namespace
}  // namespace cairn
