// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/clean.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "cairn/eval/evaluation.hpp"
#include "mesh/topology.hpp"
#include "support/meshes.hpp"

namespace cairn {
namespace {

/// Options with all cleaning steps off.
CleanOptions nothing() { return {.min_component = 0, .min_support = 0}; }

Mesh moved(Mesh mesh, const Eigen::Vector3f& by) {
  for (auto& p : mesh.positions) p += by;
  return mesh;
}

TEST(Clean, RemovesSmallOrWeaklyObservedComponents) {
  Mesh mesh = flat_grid(50, 50, 0.01f);
  mesh.weights.assign(mesh.positions.size(), 10.0f);
  const std::size_t surface = mesh.triangles.size();
  Mesh speck = moved(flat_grid(3, 3, 0.01f), {0, 0, 1});  // 4 cm
  speck.weights.assign(speck.positions.size(), 50.0f);
  append(mesh, speck);
  Mesh glimpse = moved(flat_grid(12, 12, 0.01f), {0, 0, 2});  // 17 cm
  glimpse.weights.assign(glimpse.positions.size(), 0.5f);
  append(mesh, glimpse);
  Mesh kept_component = moved(flat_grid(12, 12, 0.01f), {0, 0, 3});
  kept_component.weights.assign(kept_component.positions.size(), 5.0f);
  append(mesh, kept_component);
  const Cleaned cleaned = clean(mesh, {.min_component = 0.1f, .min_support = 2.0f});
  EXPECT_EQ(cleaned.components_removed, 2u);
  EXPECT_EQ(mesh.triangles.size(), surface + kept_component.triangles.size() - 4);  // except for corners that protrude
                                                                                    // from borders
  EXPECT_EQ(examine_topology(mesh).unreferenced_vertices, 0u);
}

TEST(Clean, RemovesWeaklyObservedSurface) {
  Mesh mesh = flat_grid(20, 20, 0.01f);
  for (const auto& p : mesh.positions) mesh.weights.push_back(p.x() < 0.105f ? 0.5f : 3.0f);
  CleanOptions options = nothing();
  options.min_weight = 1;
  clean(mesh, options);
  for (const auto& p : mesh.positions) EXPECT_GT(p.x(), 0.105f);
  EXPECT_NEAR(static_cast<double>(mesh.triangles.size()), 20 * 9 * 2, 8);
}

/// Grid with a square hole of `cells` cells a side in its middle.
Mesh with_hole(int cells) {
  Mesh mesh = flat_grid(40, 40, 0.01f);
  const float low = 0.2f, high = 0.2f + 0.01f * static_cast<float>(cells);
  std::erase_if(mesh.triangles, [&](const auto& t) {
    const Eigen::Vector3f m = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    return m.x() > low && m.x() < high && m.y() > low && m.y() < high;
  });
  return mesh;
}

TEST(Clean, ClosesHolesUpToTheMaximumSizeOnly) {
  for (const int cells : {1, 3, 7, 8}) {
    Mesh mesh = with_hole(cells);
    ASSERT_EQ(examine_topology(mesh).borders, 2u);
    CleanOptions options = nothing();
    options.fill_holes = 0.1f;  // slightly more than a diagonal of 7 cells
    const Cleaned cleaned = clean(mesh, options);
    const MeshTopology topology = examine_topology(mesh);
    EXPECT_EQ(cleaned.holes_filled, cells <= 7 ? 1u : 0u) << cells;
    EXPECT_EQ(topology.borders, cells <= 7 ? 1u : 2u) << cells;
    EXPECT_EQ(topology.non_manifold_edges, 0u);
    for (const auto& t : mesh.triangles) {  // consistent orientation
      const Eigen::Vector3f n =
          (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
      ASSERT_GT(n.z(), 0) << cells;
    }
  }
}

TEST(Clean, ClosesAHoleInASphereAndNothingElse) {
  Mesh mesh = sphere_mesh(4);
  std::erase_if(mesh.triangles, [&](const auto& t) { return mesh.positions[t[0]].z() > 0.98f; });
  CleanOptions options = nothing();
  options.fill_holes = 1;
  EXPECT_EQ(clean(mesh, options).holes_filled, 1u);
  EXPECT_EQ(examine_topology(mesh).border_edges, 0u);
}

TEST(Clean, MakesBordersThatFollowVoxelsSmooth) {
  // Steps of one square along a slanted line.
  Mesh mesh = flat_grid(60, 60, 0.01f);
  std::erase_if(mesh.triangles, [&](const auto& t) {
    const Eigen::Vector3f m = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    return std::floor(m.y() * 100) > 10 + std::floor(m.x() * 50);
  });
  const double before = examine_topology(mesh).border_length;
  clean(mesh, nothing());
  const double straight = 0.6 + 0.1 + std::hypot(0.6, 0.3) + 0.4;
  EXPECT_LT(examine_topology(mesh).border_length - straight, 0.3 * (before - straight));
  for (const auto& p : mesh.positions) EXPECT_EQ(p.z(), 0);
}

TEST(MakeManifold, LeavesAtMostTwoTrianglesPerSideAndNoneWithoutArea) {
  Mesh mesh = flat_grid(4, 4, 0.1f);
  mesh.positions.emplace_back(0.15f, 0.15f, 0.5f);
  mesh.normals.emplace_back(0, 0, 1);
  const auto fin = static_cast<std::uint32_t>(mesh.positions.size() - 1);
  mesh.triangles.push_back({6, 7, fin});
  mesh.triangles.push_back({0, 0, 1});
  mesh.triangles.push_back({0, 1, 2});  // collinear
  EXPECT_GT(examine_topology(mesh).non_manifold_edges, 0u);
  EXPECT_EQ(examine_topology(mesh).degenerate_triangles, 2u);
  make_manifold(mesh);
  EXPECT_EQ(examine_topology(mesh).non_manifold_edges, 0u);
  EXPECT_EQ(examine_topology(mesh).degenerate_triangles, 0u);
}

TEST(MakeManifold, RemovesCoincidentTriangles) {
  Mesh mesh = flat_grid(4, 4, 0.1f);
  const std::size_t surface = mesh.triangles.size();
  // A sheet of two triangles with opposite normals, with separate vertices at the same positions, and one duplicate.
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const int copy : {0, 1})
    for (const Eigen::Vector3f& p : {Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(1, 0, 1), Eigen::Vector3f(0, 1, 1)}) {
      mesh.positions.push_back(p);
      mesh.normals.emplace_back(0, 0, copy == 0 ? 1 : -1);
    }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first + 5, first + 4, first + 3});
  mesh.triangles.push_back(mesh.triangles[0]);
  EXPECT_EQ(examine_topology(mesh).coincident_triangles, 2u);
  make_manifold(mesh);
  EXPECT_EQ(mesh.triangles.size(), surface);
  EXPECT_EQ(examine_topology(mesh).coincident_triangles, 0u);
}

TEST(MakeManifold, LeavesTheLargestFanAtAVertex) {
  // Two pyramids without a base and of different size, touching at their tips.
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 1, 1}, {-1, 1, 1}, {-1, -1, 1}, {1, -1, 1}};
  for (std::size_t k = 1; k < 5; ++k) mesh.positions.emplace_back(-0.5f * mesh.positions[k]);
  for (const std::uint32_t base : {5u, 1u})
    for (std::uint32_t k = 0; k < 4; ++k) mesh.triangles.push_back({0, base + k, base + (k + 1) % 4});
  EXPECT_EQ(examine_topology(mesh).non_manifold_vertices, 1u);
  Mesh fixed = mesh;
  EXPECT_EQ(make_manifold(fixed, {.fixed = [](std::uint32_t v) { return v == 0; }}), 0u);
  EXPECT_EQ(make_manifold(mesh), 4u);
  EXPECT_EQ(examine_topology(mesh).non_manifold_vertices, 0u);
  for (const auto& t : mesh.triangles) EXPECT_LE(t[1], 4u);
}

TEST(Clean, CountsAComponentAtItsFirstTriangle) {
  Mesh mesh = flat_grid(50, 50, 0.01f);
  append(mesh, moved(flat_grid(3, 3, 0.01f), {0.1f, 0, 1}));
  const auto count = [&](bool left) {
    Mesh copy = mesh;
    return clean(copy, {.min_component = 0.1f, .min_support = 0},
                 [&, left](const auto& t) { return (copy.positions[t[0]].x() < 0.112f) == left; })
        .components_removed;
  };
  EXPECT_EQ(count(true), 1u);
  EXPECT_EQ(count(false), 0u);
}

TEST(Topology, TreatsVerticesAtIdenticalPositionsAsOne) {
  Mesh mesh = flat_grid(2, 1, 1.0f);
  mesh.positions.push_back(mesh.positions[1]);
  mesh.positions.push_back(mesh.positions[4]);
  mesh.positions.emplace_back(9, 9, 9);  // unreferenced
  for (std::size_t i = 2; i < 4; ++i)
    for (auto& v : mesh.triangles[i]) v = v == 1 ? 6 : v == 4 ? 7 : v;
  const MeshTopology topology = examine_topology(mesh);
  EXPECT_EQ(topology.components, 1u);
  EXPECT_EQ(topology.border_edges, 6u);
  EXPECT_DOUBLE_EQ(topology.border_length, 6.0);
  EXPECT_EQ(topology.unreferenced_vertices, 1u);
}

}  // namespace
}  // namespace cairn
