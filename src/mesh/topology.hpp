// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How triangles hang together.
#pragma once
#include <cstdint>
#include <unordered_set>
#include <utility>
#include <vector>

#include "base/mesh_vertices.hpp"
#include "cairn/mesh.hpp"

namespace cairn {

constexpr std::uint32_t kNone = 0xffffffffu;

/// By vertex, the first one at the very same position: vertices count as one where these ids are the same.
[[nodiscard]] std::vector<std::uint32_t> weld(const Mesh& mesh);
/// By vertex, itself.
[[nodiscard]] std::vector<std::uint32_t> own_ids(const Mesh& mesh);

/// A side of a triangle: from the vertex of its corner to that of its next one.
struct Side {
  std::uint64_t edge;      // lower vertex << 32 | higher vertex
  std::uint32_t triangle;  // its number
  std::uint32_t corner;    // 0 to 2
};
/// All sides, those of the same edge one after the other, by triangle.
[[nodiscard]] std::vector<Side> sides_by_edge(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id);

/// Calls `visit(first, last)` for the sides of each edge.
template <class Visit>
void for_each_edge(const std::vector<Side>& sides, const Visit& visit) {
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].edge == sides[begin].edge) ++end;
    visit(begin, end);
  }
}

/// The border goes from `from` to `to` with the surface on its left.
struct BoundaryEdge {
  std::uint32_t from, to;
};
[[nodiscard]] std::vector<BoundaryEdge> boundary_edges(const Mesh& mesh, const std::vector<Side>& sides);

/// Fans: the triangles at a vertex that hang together by sides which end there. A manifold has one at each vertex.
struct Fans {
  std::vector<std::uint32_t> of_corner;       // by 3 * triangle + corner, the fan's own number
  std::unordered_set<std::uint32_t> several;  // vertices with more than one
};
/// `sides` that more than two triangles share join all of these.
[[nodiscard]] Fans fans_of(const Mesh& mesh, const std::vector<Side>& sides,
                           const std::vector<std::uint32_t>& vertex_id);

/// Parts that no shared vertex joins, by triangle; counted from 0 in the order of their first triangles.
struct Components {
  std::vector<std::uint32_t> of_triangle;
  std::uint32_t count = 0;
};
[[nodiscard]] Components connected_components(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id);

/// Parts one after the other, without textures; normals and colours only where all parts have them.
[[nodiscard]] Mesh joined(const std::vector<Mesh>& parts);
/// The same, and vertices at the same position become one: what textures and cells had of their own goes together.
/// Triangles that have no area then are dropped.
[[nodiscard]] Mesh welded(const std::vector<Mesh>& parts);

}  // namespace cairn
