// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <array>
#include <set>
#include <unordered_set>

#include "base/union_find.hpp"
#include "cairn/eval/evaluation.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

bool is_degenerate(const Mesh& mesh, const std::array<std::uint32_t, 3>& t,
                   const std::vector<std::uint32_t>& vertex_id) {
  if (vertex_id[t[0]] == vertex_id[t[1]] || vertex_id[t[1]] == vertex_id[t[2]] || vertex_id[t[2]] == vertex_id[t[0]])
    return true;
  const Eigen::Vector3d a = mesh.positions[t[0]].cast<double>();
  return !((mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a).norm() > 0);
}

}  // namespace

MeshTopology examine_topology(const Mesh& mesh) {
  MeshTopology topology;
  const std::vector<std::uint32_t> vertex_id = weld(mesh);
  std::vector<bool> used(mesh.positions.size(), false);
  for (const auto& t : mesh.triangles) {
    topology.degenerate_triangles += is_degenerate(mesh, t, vertex_id);
    for (const std::uint32_t v : t) used[v] = true;
  }
  topology.unreferenced_vertices = static_cast<std::size_t>(std::count(used.begin(), used.end(), false));
  const std::vector<Side> sides = sides_by_edge(mesh, vertex_id);
  topology.non_manifold_vertices = vertices_with_several_fans(mesh, vertex_id).size();
  std::set<std::array<std::uint32_t, 3>> corners;
  for (const auto& t : mesh.triangles) {
    std::array<std::uint32_t, 3> c{vertex_id[t[0]], vertex_id[t[1]], vertex_id[t[2]]};
    std::sort(c.begin(), c.end());
    topology.coincident_triangles += !corners.insert(c).second;
  }
  // Border edges with a common vertex belong to the same border.
  std::vector<std::array<std::uint32_t, 2>> border;
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    topology.non_manifold_edges += end - begin > 2;
    if (end - begin != 1) return;
    ++topology.border_edges;
    const std::uint32_t a = static_cast<std::uint32_t>(sides[begin].edge >> 32),
                        b = static_cast<std::uint32_t>(sides[begin].edge);
    topology.border_length += static_cast<double>((mesh.positions[a] - mesh.positions[b]).norm());
    border.push_back({a, b});
  });
  UnionFind<std::uint32_t> sets(mesh.positions.size());
  for (const auto& [from, to] : border) sets.join(from, to);
  std::unordered_set<std::size_t> borders;
  for (const auto& [from, to] : border) borders.insert(sets.find(from));
  topology.borders = borders.size();
  topology.components = connected_components(mesh, vertex_id).count;
  return topology;
}

}  // namespace cairn
