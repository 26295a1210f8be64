// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/topology.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <set>
#include <tuple>
#include <unordered_map>
#include <unordered_set>

#include "base/union_find.hpp"
#include "geometry/mesh_vertices.hpp"

namespace cairn {
namespace {

struct PositionHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& p) const {  // Teschner et al. 2003
    return p[0] * std::size_t{73856093} ^ p[1] * std::size_t{19349669} ^ p[2] * std::size_t{83492791};
  }
};

}  // namespace

std::vector<std::uint32_t> weld(const Mesh& mesh) {
  std::unordered_map<std::array<std::uint32_t, 3>, std::uint32_t, PositionHash> first;
  first.reserve(mesh.positions.size());
  std::vector<std::uint32_t> vertex_id(mesh.positions.size());
  for (std::size_t v = 0; v < vertex_id.size(); ++v) {
    const Eigen::Vector3f p = mesh.positions[v] + Eigen::Vector3f::Zero();  // -0 becomes +0
    vertex_id[v] = first
                       .try_emplace({std::bit_cast<std::uint32_t>(p.x()), std::bit_cast<std::uint32_t>(p.y()),
                                     std::bit_cast<std::uint32_t>(p.z())},
                                    static_cast<std::uint32_t>(v))
                       .first->second;
  }
  return vertex_id;
}

std::vector<std::uint32_t> own_ids(const Mesh& mesh) {
  std::vector<std::uint32_t> vertex_id(mesh.positions.size());
  std::iota(vertex_id.begin(), vertex_id.end(), 0u);
  return vertex_id;
}

std::vector<Side> sides_by_edge(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id) {
  std::vector<Side> sides(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::uint32_t c = 0; c < 3; ++c) {
      const std::uint64_t a = vertex_id[mesh.triangles[t][c]], b = vertex_id[mesh.triangles[t][(c + 1) % 3]];
      sides[3 * t + c] = {std::min(a, b) << 32 | std::max(a, b), static_cast<std::uint32_t>(t), c};
    }
  tbb::parallel_sort(sides, [](const Side& a, const Side& b) {
    return std::tie(a.edge, a.triangle, a.corner) < std::tie(b.edge, b.triangle, b.corner);
  });
  return sides;
}

std::vector<BoundaryEdge> boundary_edges(const Mesh& mesh, const std::vector<Side>& sides) {
  std::vector<BoundaryEdge> boundary_edges;
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if (end - begin != 1) return;
    const auto& t = mesh.triangles[sides[begin].triangle];
    boundary_edges.push_back({t[sides[begin].corner], t[(sides[begin].corner + 1) % 3]});
  });
  return boundary_edges;
}

Fans fans_of(const Mesh& mesh, const std::vector<Side>& sides, const std::vector<std::uint32_t>& vertex_id) {
  UnionFind<std::uint32_t> sets(3 * mesh.triangles.size());
  const auto vertex = [&](std::size_t corner) { return vertex_id[mesh.triangles[corner / 3][corner % 3]]; };
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    const auto ends = [&](const Side& s) {
      std::array<std::uint32_t, 2> corners{3 * s.triangle + s.corner, 3 * s.triangle + (s.corner + 1) % 3};
      if (vertex(corners[0]) > vertex(corners[1])) std::swap(corners[0], corners[1]);
      return corners;
    };
    const auto first = ends(sides[begin]);
    for (std::size_t i = begin + 1; i < end; ++i) {
      const auto more = ends(sides[i]);
      sets.join(first[0], more[0]);
      sets.join(first[1], more[1]);
    }
  });
  Fans fans{.of_corner = sets.all(), .several = {}};
  std::vector<std::uint32_t> fan_at(mesh.positions.size(), kNone);
  for (std::size_t corner = 0; corner < fans.of_corner.size(); ++corner) {
    std::uint32_t& fan = fan_at[vertex(corner)];
    if (fan == kNone) fan = fans.of_corner[corner];
    if (fan != fans.of_corner[corner]) fans.several.insert(vertex(corner));
  }
  return fans;
}

Components connected_components(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id) {
  UnionFind<std::uint32_t> sets(mesh.positions.size());
  for (const auto& t : mesh.triangles)
    for (const std::size_t k : {1u, 2u}) sets.join(vertex_id[t[0]], vertex_id[t[k]]);
  Components components;
  std::vector<std::uint32_t> number(mesh.positions.size(), kNone);
  for (const auto& t : mesh.triangles) {
    std::uint32_t& n = number[sets.find(vertex_id[t[0]])];
    if (n == kNone) n = components.count++;
    components.of_triangle.push_back(n);
  }
  return components;
}

Mesh joined(const std::vector<Mesh>& parts) {
  Mesh all;
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  for (const Mesh& part : parts) {
    const auto first = static_cast<std::uint32_t>(all.positions.size());
    append(all.positions, part.positions);
    append(all.normals, part.normals);
    append(all.colors, part.colors);
    append(all.sigmas, part.sigmas);
    for (const auto& t : part.triangles) all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  if (all.normals.size() != all.positions.size()) all.normals.clear();
  if (all.colors.size() != all.positions.size()) all.colors.clear();
  if (all.sigmas.size() != all.positions.size()) all.sigmas.clear();
  return all;
}

Mesh welded(const std::vector<Mesh>& parts) {
  Mesh mesh = joined(parts);
  const std::vector<std::uint32_t> first = weld(mesh);
  for (auto& t : mesh.triangles)
    for (std::uint32_t& v : t) v = first[v];
  std::erase_if(mesh.triangles, [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  drop_unused_vertices(mesh);
  return mesh;
}

}  // namespace cairn
