// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/incremental_mesher.hpp"

#include <gtest/gtest.h>

#include <map>

#include "cairn/mapping/live_surface.hpp"
#include "cairn/mapping/mapper.hpp"
#include "support/scenes.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

using Place = std::tuple<int, int, int, int>;  // submap, cell

/// Maps some frames of the room, with a request for the surface after each; keeps the newest version of every block.
struct Watched {
  std::map<Place, Mesh> parts;
  std::map<Place, int> times;
  std::size_t max_triangles = 0;  // in one answer

  void take(const SurfaceChanges& changes) {
    std::size_t triangles = 0;
    for (const SurfaceBlock& part : changes.parts) {
      const Place place{part.submap, part.cell.x(), part.cell.y(), part.cell.z()};
      parts[place] = part.mesh;
      ++times[place];
      triangles += part.mesh.triangles.size();
    }
    max_triangles = std::max(max_triangles, triangles);
  }
  [[nodiscard]] std::size_t triangles() const {
    std::size_t all = 0;
    for (const auto& [place, mesh] : parts) all += mesh.triangles.size();
    return all;
  }
};

TEST(IncrementalMesher, ConvergesToTheFullMeshAtSmallCostPerFrame) {
  const auto source = open_synthetic({.scene = "room", .first = 0, .frames = 40});
  Mapper mapper(source->rig());
  LiveSurface surface(mapper);
  Watched watched;
  while (const auto frame = source->next()) {
    (void)mapper.add(*frame);
    watched.take(surface.changes(300));
  }
  const std::size_t before = watched.triangles();
  for (int i = 0; i < 100; ++i) watched.take(surface.changes(300, true));
  const Mesh full_mesh = mapper.map().mesh();
  // Blocks are meshed one after the other, so a few triangles at their borders may be older.
  EXPECT_NEAR(static_cast<double>(watched.triangles()), static_cast<double>(full_mesh.triangles.size()),
              0.002 * static_cast<double>(full_mesh.triangles.size()));
  EXPECT_GT(before, full_mesh.triangles.size() * 8 / 10);
  EXPECT_LT(watched.max_triangles, 60000u);  // some 100 per brick
  int max_value = 0;
  for (const auto& [place, times] : watched.times) max_value = std::max(max_value, times);
  EXPECT_LE(max_value, 15);  // of 40 frames
  EXPECT_TRUE(surface.changes(300, true).parts.empty());
}

TEST(IncrementalMesher, UpdatesEveryLiveSurface) {
  const auto source = open_synthetic({.scene = "room", .first = 0, .frames = 4});
  Mapper mapper(source->rig());
  LiveSurface first(mapper);
  std::optional<LiveSurface> second;
  Watched a, b;
  for (int i = 0; const auto frame = source->next(); ++i) {
    (void)mapper.add(*frame);
    a.take(first.changes());
    if (i == 1) second.emplace(mapper);
  }
  a.take(first.changes(1 << 20, true));
  b.take(second->changes(1 << 20, true));
  EXPECT_EQ(a.parts.size(), b.parts.size());
  EXPECT_NEAR(static_cast<double>(a.triangles()), static_cast<double>(b.triangles()), 0.002 * b.triangles());
  second.reset();
  EXPECT_TRUE(first.changes(1 << 20, true).parts.empty());
}

TEST(IncrementalMesher, MatchesThePositionsOfTheFullMesh) {
  const auto source = open_synthetic({.scene = "room", .first = 0, .frames = 5});
  Mapper mapper(source->rig(), {.up = Up::minus_y});  // no rotation: the viewer's page applies it
  while (const auto frame = source->next()) (void)mapper.add(*frame);
  const SurfaceChanges changes = LiveSurface(mapper).changes(1 << 20, true);
  ASSERT_EQ(changes.world_from_submap.size(), 1u);
  EXPECT_TRUE(changes.world_from_submap[0].matrix().isIdentity());
  Eigen::AlignedBox3f box, full_mesh;
  for (const SurfaceBlock& part : changes.parts)
    for (const auto& p : part.mesh.positions) {
      box.extend(p);
      const Eigen::Vector3f in_cell = p / (IncrementalMesher::kCell * 0.08f) - part.cell.cast<float>();
      EXPECT_GT(in_cell.minCoeff(), -0.05f);  // a voxel's triangle extends up to a voxel beyond
      EXPECT_LT(in_cell.maxCoeff(), 1.05f);
    }
  for (const auto& p : mapper.map().mesh().positions) full_mesh.extend(p);
  EXPECT_TRUE(box.isApprox(full_mesh, 1e-5f)) << box.min().transpose() << ", " << box.max().transpose() << " and "
                                              << full_mesh.min().transpose() << ", " << full_mesh.max().transpose();
}

TEST(IncrementalMesher, EncodesTheObservationCountOfAPlane) {
  const Camera camera{.width = 160, .height = 120, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
  Mapper mapper(camera, {}, Poses::given);
  Frame frame{.depth = std::vector<float>(160 * 120, 1.0f), .color = {}};
  frame.world_from_camera = Eigen::Isometry3d::Identity();
  for (const auto& [seen, byte] : {std::pair(1, 90), {2, 128}, {4, 180}, {8, 255}, {12, 255}}) {  // 255 sqrt(n / 8)
    while (frame.index < seen) {
      frame.timestamp = 0.1 * ++frame.index;
      frame.depth[0] = 1 + 0.001f * static_cast<float>(frame.index);  // an identical image would be a stuck sensor
      ASSERT_EQ(mapper.add(frame).state, FrameState::fused);
    }
    int vertices = 0;
    for (const SurfaceBlock& part : LiveSurface(mapper).changes(1 << 20, true).parts)
      for (std::size_t v = 0; v < part.mesh.positions.size(); ++v) {
        if (part.mesh.positions[v].head<2>().cwiseAbs().maxCoeff() > 0.3f) continue;  // the image's edge
        EXPECT_EQ(int{part.mesh.colors[v][3]}, byte) << seen << " times";
        ++vertices;
      }
    EXPECT_GT(vertices, 3000) << seen;
  }
}

TEST(IncrementalMesher, ReportsTheCoverageOfTheCurrentView) {
  const auto source = open_synthetic({.scene = "room", .first = 0, .frames = 25});
  Mapper mapper(source->rig());
  LiveSurface surface(mapper);
  EXPECT_FALSE(surface.changes(1000).coverage);
  std::vector<double> coverage;
  while (const auto frame = source->next()) {
    (void)mapper.add(*frame);
    coverage.push_back(surface.changes(1000).coverage.value());
  }
  EXPECT_EQ(coverage.front(), 0);  // unknown surface so far
  EXPECT_GT(coverage[5], 0.1);
  EXPECT_GT(coverage.back(), coverage[5] + 0.1);
  EXPECT_LE(coverage.back(), 1);
}

}  // namespace
}  // namespace cairn
