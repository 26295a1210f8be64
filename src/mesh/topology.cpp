// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/topology.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <tuple>
#include <unordered_map>

#include "cairn/evaluation.hpp"

namespace cairn {
namespace {

struct PlaceHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& p) const {  // Teschner et al. 2003
    return p[0] * std::size_t{73856093} ^ p[1] * std::size_t{19349669} ^ p[2] * std::size_t{83492791};
  }
};

bool is_degenerate(const Mesh& mesh, const std::array<std::uint32_t, 3>& t, const std::vector<std::uint32_t>& name) {
  if (name[t[0]] == name[t[1]] || name[t[1]] == name[t[2]] || name[t[2]] == name[t[0]]) return true;
  const Eigen::Vector3d a = mesh.positions[t[0]].cast<double>();
  return !((mesh.positions[t[1]].cast<double>() - a).cross(mesh.positions[t[2]].cast<double>() - a).norm() > 0);
}

}  // namespace

std::vector<std::uint32_t> weld(const Mesh& mesh) {
  std::unordered_map<std::array<std::uint32_t, 3>, std::uint32_t, PlaceHash> first;
  first.reserve(mesh.positions.size());
  std::vector<std::uint32_t> name(mesh.positions.size());
  for (std::size_t v = 0; v < name.size(); ++v) {
    const Eigen::Vector3f p = mesh.positions[v] + Eigen::Vector3f::Zero();  // there is one zero only
    name[v] = first
                  .try_emplace({std::bit_cast<std::uint32_t>(p.x()), std::bit_cast<std::uint32_t>(p.y()),
                                std::bit_cast<std::uint32_t>(p.z())},
                               static_cast<std::uint32_t>(v))
                  .first->second;
  }
  return name;
}

std::vector<Side> sides_by_edge(const Mesh& mesh, const std::vector<std::uint32_t>& name) {
  std::vector<Side> sides(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::uint32_t c = 0; c < 3; ++c) {
      const std::uint64_t a = name[mesh.triangles[t][c]], b = name[mesh.triangles[t][(c + 1) % 3]];
      sides[3 * t + c] = {std::min(a, b) << 32 | std::max(a, b), static_cast<std::uint32_t>(t), c};
    }
  tbb::parallel_sort(sides, [](const Side& a, const Side& b) {
    return std::tie(a.edge, a.triangle, a.corner) < std::tie(b.edge, b.triangle, b.corner);
  });
  return sides;
}

Components connected_components(const Mesh& mesh, const std::vector<std::uint32_t>& name) {
  std::vector<std::uint32_t> parent(mesh.positions.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root = [&](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const auto& t : mesh.triangles)
    for (const std::size_t k : {1u, 2u}) {
      const std::uint32_t a = root(name[t[0]]), b = root(name[t[k]]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  Components components;
  std::vector<std::uint32_t> number(mesh.positions.size(), kNone);
  for (const auto& t : mesh.triangles) {
    std::uint32_t& n = number[root(name[t[0]])];
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
    append(all.colours, part.colours);
    for (const auto& t : part.triangles) all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  if (all.normals.size() != all.positions.size()) all.normals.clear();
  if (all.colours.size() != all.positions.size()) all.colours.clear();
  return all;
}

MeshTopology examine_topology(const Mesh& mesh) {
  MeshTopology topology;
  const std::vector<std::uint32_t> name = weld(mesh);
  std::vector<bool> used(mesh.positions.size(), false);
  for (const auto& t : mesh.triangles) {
    topology.degenerate_triangles += is_degenerate(mesh, t, name);
    for (const std::uint32_t v : t) used[v] = true;
  }
  topology.unreferenced_vertices = static_cast<std::size_t>(std::count(used.begin(), used.end(), false));
  const std::vector<Side> sides = sides_by_edge(mesh, name);
  // Borders hang together where they share a vertex.
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
  std::unordered_map<std::uint32_t, std::uint32_t> parent;
  const auto root = [&](std::uint32_t v) {
    parent.try_emplace(v, v);
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const auto& [a, b] : border) parent[root(a)] = root(b);
  for (const auto& [v, p] : parent) topology.borders += v == p;
  topology.components = connected_components(mesh, name).count;
  return topology;
}

}  // namespace cairn
