// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/growing_surface.hpp"

#include <gtest/gtest.h>

#include <map>

#include "cairn/live_surface.hpp"
#include "cairn/mapper.hpp"
#include "support/scenes.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

using Place = std::tuple<int, int, int, int>;  // submap, cell

/// Maps some frames of the room, asking for the surface after each; gives the newest of every part.
struct Watched {
  std::map<Place, Mesh> parts;
  std::map<Place, int> times;
  std::size_t most_triangles = 0;  // in one answer

  void take(const SurfaceChanges& changes) {
    std::size_t triangles = 0;
    for (const SurfacePart& part : changes.parts) {
      const Place place{part.submap, part.cell.x(), part.cell.y(), part.cell.z()};
      parts[place] = part.mesh;
      ++times[place];
      triangles += part.mesh.triangles.size();
    }
    most_triangles = std::max(most_triangles, triangles);
  }
  [[nodiscard]] std::size_t triangles() const {
    std::size_t all = 0;
    for (const auto& [place, mesh] : parts) all += mesh.triangles.size();
    return all;
  }
};

TEST(GrowingSurface, IsInTheEndTheWholeMeshAndCostsLittleByFrame) {
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
  const Mesh whole = mapper.map().mesh();
  // Parts were made one after the other, so where they meet a few triangles may be those of an earlier moment.
  EXPECT_NEAR(static_cast<double>(watched.triangles()), static_cast<double>(whole.triangles.size()),
              0.002 * static_cast<double>(whole.triangles.size()));
  EXPECT_GT(before, whole.triangles.size() * 8 / 10);
  EXPECT_LT(watched.most_triangles, 60000u);  // some 100 a brick
  int most = 0;
  for (const auto& [place, times] : watched.times) most = std::max(most, times);
  EXPECT_LE(most, 15);  // of 40 frames
  EXPECT_TRUE(surface.changes(300, true).parts.empty());
}

TEST(GrowingSurface, LiesWhereTheWholeMeshLies) {
  const auto source = open_synthetic({.scene = "room", .first = 0, .frames = 5});
  Mapper mapper(source->rig());
  while (const auto frame = source->next()) (void)mapper.add(*frame);
  const SurfaceChanges changes = LiveSurface(mapper).changes(1 << 20, true);
  ASSERT_EQ(changes.world_from_submap.size(), 1u);
  EXPECT_TRUE(changes.world_from_submap[0].matrix().isIdentity());
  Eigen::AlignedBox3f box, whole;
  for (const SurfacePart& part : changes.parts)
    for (const auto& p : part.mesh.positions) {
      box.extend(p);
      const Eigen::Vector3f in_cell = p / (GrowingSurface::kCell * 0.08f) - part.cell.cast<float>();
      EXPECT_GT(in_cell.minCoeff(), -0.05f);  // a voxel's triangle reaches a voxel beyond
      EXPECT_LT(in_cell.maxCoeff(), 1.05f);
    }
  for (const auto& p : mapper.map().mesh().positions) whole.extend(p);
  EXPECT_TRUE(box.isApprox(whole, 1e-5f));
}

}  // namespace
}  // namespace cairn
