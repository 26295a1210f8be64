// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/simplify.hpp"

#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <functional>
#include <set>

#include "cairn/eval/evaluation.hpp"
#include "eval/mesh_surface.hpp"
#include "support/meshes.hpp"

namespace cairn {
namespace {

/// Largest distance of sampled points of one surface to the other.
double max_distance(const Mesh& from, const Mesh& to) {
  const MeshSurface surface(to);
  double largest = 0;
  for (const auto& t : from.triangles)
    for (const Eigen::Vector3f& w : {Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0.34f, 0.33f, 0.33f)})
      largest = std::max(largest, surface.distance(w[0] * from.positions[t[0]] + w[1] * from.positions[t[1]] +
                                                   w[2] * from.positions[t[2]]));
  return largest;
}

TEST(Simplify, LeavesAFewTrianglesOfARectangle) {
  Mesh mesh = flat_grid(30, 20, 0.01f);
  const Simplified simplified = simplify(mesh, {.max_error = 1e-4f}, {}, false);
  // Of 1200; newer versions of meshoptimizer leave some more.
  EXPECT_LE(mesh.triangles.size(), MESHOPTIMIZER_VERSION < 200 ? 4u : 8u);
  EXPECT_LT(simplified.error, 1e-4f);
  EXPECT_NEAR(examine_topology(mesh).border_length, 1.0, 1e-4);
  EXPECT_EQ(mesh.positions.size(), mesh.normals.size());
}

TEST(Simplify, StaysWithinTheMaximumError) {
  const Mesh full = sphere_mesh(6);
  for (const float error : {0.004f, 0.01f, 0.04f}) {
    Mesh mesh = full;
    simplify(mesh, {.max_error = error}, {}, false);
    EXPECT_LT(mesh.triangles.size(), full.triangles.size() / 4) << error;
    EXPECT_LT(max_distance(full, mesh), static_cast<double>(error));
    EXPECT_LT(max_distance(mesh, full), static_cast<double>(error));
  }
}

TEST(Simplify, LeavesTheRequestedRatioWithoutHoles) {
  Mesh mesh = sphere_mesh(5);
  const std::size_t full = mesh.triangles.size();
  simplify(mesh, {.ratio = 0.1f}, {}, false);
  EXPECT_NEAR(static_cast<double>(mesh.triangles.size()), 0.1 * static_cast<double>(full), 4);
  const MeshTopology topology = examine_topology(mesh);
  EXPECT_EQ(topology.border_edges, 0u);
  EXPECT_EQ(topology.non_manifold_edges, 0u);
  EXPECT_EQ(topology.degenerate_triangles, 0u);
  EXPECT_EQ(topology.unreferenced_vertices, 0u);
}

TEST(Simplify, LeavesAtMostTheRequestedTriangles) {
  for (const std::size_t max_triangles : {std::size_t{4}, std::size_t{100}, std::size_t{1000}}) {
    SCOPED_TRACE(max_triangles);
    Mesh sphere = sphere_mesh(5);  // 8192 triangles
    simplify(sphere, {.triangles = max_triangles}, {}, true);
    EXPECT_LE(sphere.triangles.size(), max_triangles);
    EXPECT_GE(sphere.triangles.size(), max_triangles - max_triangles / 10);
    EXPECT_EQ(examine_topology(sphere).non_manifold_edges, 0u);
  }
  Mesh few = sphere_mesh(1);
  const auto before = few.triangles;
  simplify(few, {.triangles = before.size()}, {}, true);
  EXPECT_EQ(few.triangles, before);
}

TEST(Simplify, DropsConstraintsForVeryFewTriangles) {
  // Every vertex is locked, and each of 50 components has two colors: both constraints must be dropped.
  Mesh components;
  for (int i = 0; i < 50; ++i) {
    Mesh component = sphere_mesh(2);
    for (auto& p : component.positions) p += Eigen::Vector3f(3 * static_cast<float>(i), 0, 0);
    append(components, component);
  }
  for (const auto& p : components.positions)
    components.colors.push_back(p.y() > 0 ? std::array<std::uint8_t, 4>{250, 0, 0, 255}
                                          : std::array<std::uint8_t, 4>{0, 0, 250, 255});
  for (const std::size_t max_triangles : {std::size_t{3000}, std::size_t{600}, std::size_t{60}}) {
    Mesh fewer = components;
    simplify(fewer, {.triangles = max_triangles}, std::vector<bool>(components.positions.size(), true), true);
    EXPECT_LE(fewer.triangles.size(), max_triangles);
    EXPECT_GT(fewer.triangles.size(), max_triangles / 4);
    EXPECT_EQ(fewer.colors.size(), fewer.positions.size());
  }
}

TEST(Simplify, KeepsLockedVertices) {
  Mesh mesh = flat_grid(30, 30, 0.01f);
  std::vector<bool> locked;
  std::set<std::pair<float, float>> places;
  for (const auto& p : mesh.positions) {
    locked.push_back(p.x() == 0);
    if (p.x() == 0) places.emplace(p.x(), p.y());
  }
  const Simplified simplified = simplify(mesh, {.max_error = 1e-3f}, locked, false);
  EXPECT_LT(mesh.triangles.size(), 50u);
  for (const auto& p : mesh.positions) places.erase({p.x(), p.y()});
  EXPECT_TRUE(places.empty());
  for (std::size_t i = 0; i < simplified.kept.size(); ++i)
    EXPECT_EQ(mesh.positions[i].y(), 0.01f * static_cast<float>(simplified.kept[i] / 31));
}

/// Largest difference between the color of the mesh and the true color, at the middles of triangles away from color
/// edges.
double color_error(const Mesh& mesh, const std::function<int(const Eigen::Vector3f&)>& truth) {
  double sum = 0, area = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    const double size = static_cast<double>((b - a).cross(c - a).norm());
    const int color = (mesh.colors[t[0]][0] + mesh.colors[t[1]][0] + mesh.colors[t[2]][0]) / 3;
    sum += size * std::abs(color - truth((a + b + c) / 3));
    area += size;
  }
  return sum / area;
}

TEST(Simplify, KeepsColorEdges) {
  const auto stripes = [](const Eigen::Vector3f& p) { return static_cast<int>(p.x() / 0.2f) % 2 == 0 ? 40 : 220; };
  Mesh full = flat_grid(100, 100, 0.01f);
  for (const auto& p : full.positions) {
    const auto c = static_cast<std::uint8_t>(stripes(p + Eigen::Vector3f(0.005f, 0, 0)));
    full.colors.push_back({c, c, c, 255});
  }
  Mesh kept = full, lost = full;
  simplify(kept, {.ratio = 0.02f}, {}, true);
  simplify(lost, {.ratio = 0.02f}, {}, false);
  EXPECT_LE(kept.triangles.size(), full.triangles.size() / 25);
  EXPECT_LT(color_error(kept, stripes), 12) << "beside " << color_error(lost, stripes);
  EXPECT_GT(color_error(lost, stripes), 2 * color_error(kept, stripes));
}

TEST(ColorRegions, FollowColorsDespiteNoise) {
  Mesh mesh = flat_grid(60, 60, 0.01f);
  std::uint32_t state = 1;
  for (const auto& p : mesh.positions) {
    state = state * 1664525u + 1013904223u;
    const auto c = static_cast<std::uint8_t>((p.x() < 0.3f ? 60 : 160) + static_cast<int>(state >> 29));
    mesh.colors.push_back({c, c, c, 255});
  }
  const auto region = color_regions(mesh);
  EXPECT_EQ(std::set(region.begin(), region.end()).size(), 2u);
}

}  // namespace
}  // namespace cairn
