// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mesh/topology.hpp"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <set>
#include <utility>

#include "base/union_find.hpp"
#include "geometry/mesh_vertices.hpp"

namespace cairn {
namespace {

using PositionBits = std::array<std::uint32_t, 3>;

PositionBits bits_of(const Eigen::Vector3f& position) {
  const Eigen::Vector3f p = position + Eigen::Vector3f::Zero();  // -0 becomes +0
  return {std::bit_cast<std::uint32_t>(p.x()), std::bit_cast<std::uint32_t>(p.y()),
          std::bit_cast<std::uint32_t>(p.z())};
}

/// Spatial hash (Teschner et al. 2003) with its highest bits mixed.
std::uint64_t hash_of(const PositionBits& p) {
  const std::uint64_t mixed =
      p[0] * std::uint64_t{73856093} ^ p[1] * std::uint64_t{19349669} ^ p[2] * std::uint64_t{83492791};
  return (mixed ^ mixed >> 29) * 0x9e3779b97f4a7c15u;  // Fibonacci hashing (Knuth 1998, 6.4)
}

/// Vertex of another corner of a triangle, `k` corners after this one.
std::uint32_t neighbor(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id, std::uint32_t corner,
                       std::uint32_t k) {
  return vertex_id[mesh.triangles[corner / 3][(corner % 3 + k) % 3]];
}

tbb::blocked_range<std::uint32_t> all_vertices(const Mesh& mesh) {
  return {0, static_cast<std::uint32_t>(mesh.positions.size())};
}

/// All that the threads found.
template <class T>
std::vector<T> sorted(const tbb::enumerable_thread_specific<std::vector<T>>& by_thread) {
  std::vector<T> all;
  for (const std::vector<T>& part : by_thread) all.insert(all.end(), part.begin(), part.end());
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace

std::vector<std::uint32_t> weld(const Mesh& mesh) {
  // Hash table with linear probing: the first vertex of each position.
  const std::size_t slots = std::bit_ceil(2 * mesh.positions.size() + 2);
  const int shift = 64 - std::countr_zero(slots);
  std::vector<std::uint32_t> first(slots, kNone), vertex_id(mesh.positions.size());
  for (std::uint32_t v = 0; v < vertex_id.size(); ++v) {
    const PositionBits bits = bits_of(mesh.positions[v]);
    std::size_t slot = hash_of(bits) >> shift;
    while (first[slot] != kNone && bits_of(mesh.positions[first[slot]]) != bits) slot = (slot + 1) & (slots - 1);
    if (first[slot] == kNone) first[slot] = v;
    vertex_id[v] = first[slot];
  }
  return vertex_id;
}

std::vector<std::uint32_t> own_ids(const Mesh& mesh) {
  std::vector<std::uint32_t> vertex_id(mesh.positions.size());
  std::iota(vertex_id.begin(), vertex_id.end(), 0u);
  return vertex_id;
}

Side side_of(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id, std::uint32_t triangle,
             std::uint32_t corner) {
  const auto& t = mesh.triangles[triangle];
  const std::uint64_t a = vertex_id[t[corner]], b = vertex_id[t[(corner + 1) % 3]];
  return {std::min(a, b) << 32 | std::max(a, b), triangle, corner};
}

std::vector<Side> sides_by_edge(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id) {
  // Counting sort by the lower vertex; the few sides of each are then sorted by the higher one.
  std::vector<std::uint32_t> end(mesh.positions.size() + 1, 0);  // first the place of the next side, by lower vertex
  for (const auto& t : mesh.triangles)
    for (std::uint32_t c = 0; c < 3; ++c) ++end[std::min(vertex_id[t[c]], vertex_id[t[(c + 1) % 3]]) + 1];
  std::partial_sum(end.begin(), end.end(), end.begin());
  std::vector<Side> sides(3 * mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::uint32_t c = 0; c < 3; ++c) {
      const Side side = side_of(mesh, vertex_id, t, c);
      sides[end[side.edge >> 32]++] = side;
    }
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, mesh.positions.size()), [&](const auto& range) {
    for (std::size_t v = range.begin(); v < range.end(); ++v)
      std::sort(sides.begin() + (v == 0 ? 0 : end[v - 1]), sides.begin() + end[v]);
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

CornersByVertex::CornersByVertex(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id)
    : end_(mesh.positions.size() + 1, 0), corners_(3 * mesh.triangles.size()) {
  // Counting sort: end_[v] is first the place of the next corner of v.
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t v : t) ++end_[vertex_id[v] + 1];
  std::partial_sum(end_.begin(), end_.end(), end_.begin());
  std::uint32_t corner = 0;
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t v : t) corners_[end_[vertex_id[v]]++] = corner++;
}

void sides_at(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id, std::uint32_t vertex,
              std::span<const std::uint32_t> corners, std::vector<Side>& sides) {
  sides.clear();
  for (const std::uint32_t corner : corners) {
    const std::uint32_t triangle = corner / 3, c = corner % 3, before = (c + 2) % 3;
    if (vertex_id[mesh.triangles[triangle][(c + 1) % 3]] >= vertex)
      sides.push_back(side_of(mesh, vertex_id, triangle, c));
    if (vertex_id[mesh.triangles[triangle][before]] > vertex)
      sides.push_back(side_of(mesh, vertex_id, triangle, before));
  }
  std::sort(sides.begin(), sides.end());
}

std::vector<Side> border_sides(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id,
                               const CornersByVertex& corners) {
  tbb::enumerable_thread_specific<std::vector<Side>> found, scratch;
  tbb::parallel_for(all_vertices(mesh), [&](const auto& range) {
    std::vector<Side>&at_vertex = scratch.local(), &border = found.local();
    for (std::uint32_t v = range.begin(); v < range.end(); ++v) {
      sides_at(mesh, vertex_id, v, corners.at(v), at_vertex);
      for_each_edge(at_vertex, [&](std::size_t begin, std::size_t end) {
        if (end - begin == 1) border.push_back(at_vertex[begin]);
      });
    }
  });
  return sorted(found);
}

std::vector<std::uint32_t> fans_at(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id,
                                   std::span<const std::uint32_t> corners) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> neighbors;  // other vertex of a side, index of the corner
  neighbors.reserve(2 * corners.size());
  for (std::uint32_t i = 0; i < corners.size(); ++i)
    for (const std::uint32_t k : {1u, 2u}) neighbors.emplace_back(neighbor(mesh, vertex_id, corners[i], k), i);
  std::sort(neighbors.begin(), neighbors.end());
  UnionFind<std::uint32_t> sets(corners.size());
  for (std::size_t i = 1; i < neighbors.size(); ++i)
    if (neighbors[i].first == neighbors[i - 1].first) sets.join(neighbors[i].second, neighbors[i - 1].second);
  return sets.all();
}

bool are_several_fans(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id,
                      std::span<const std::uint32_t> corners) {
  constexpr std::size_t kMaxSmallFan = 32;  // corners
  if (corners.size() > kMaxSmallFan)
    return std::ranges::any_of(fans_at(mesh, vertex_id, corners), [](std::uint32_t fan) { return fan != 0; });
  std::array<std::uint32_t, 2 * kMaxSmallFan> neighbors{};  // two per corner, those of connected corners first
  const std::size_t count = 2 * corners.size();
  for (std::size_t i = 0; i < count; ++i)
    neighbors[i] = neighbor(mesh, vertex_id, corners[i / 2], 1 + static_cast<std::uint32_t>(i % 2));
  std::size_t connected = std::min<std::size_t>(2, count);
  for (std::size_t i = 0; i < connected; ++i)
    for (std::size_t k = connected; k < count; k += 2) {
      if (neighbors[k] != neighbors[i] && neighbors[k + 1] != neighbors[i]) continue;
      std::swap(neighbors[k], neighbors[connected]);
      std::swap(neighbors[k + 1], neighbors[connected + 1]);
      connected += 2;
    }
  return connected < count;
}

std::vector<std::uint32_t> vertices_with_several_fans(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id) {
  const CornersByVertex corners(mesh, vertex_id);
  tbb::enumerable_thread_specific<std::vector<std::uint32_t>> found;
  tbb::parallel_for(all_vertices(mesh), [&](const auto& range) {
    for (std::uint32_t v = range.begin(); v < range.end(); ++v)
      if (are_several_fans(mesh, vertex_id, corners.at(v))) found.local().push_back(v);
  });
  return sorted(found);
}

Components connected_components(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id) {
  UnionFind<std::uint32_t> sets(mesh.positions.size());
  for (const auto& t : mesh.triangles)
    for (const std::size_t k : {1u, 2u}) sets.join(vertex_id[t[0]], vertex_id[t[k]]);
  Components components;
  components.of_triangle.reserve(mesh.triangles.size());
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
