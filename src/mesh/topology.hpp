// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Connectivity of triangles.
#pragma once
#include <cstdint>
#include <unordered_set>
#include <utility>
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "geometry/mesh_vertices.hpp"

namespace cairn {

constexpr std::uint32_t kNone = 0xffffffffu;

/// For each vertex, the first vertex at the identical position: vertices with equal ids count as one.
[[nodiscard]] std::vector<std::uint32_t> weld(const Mesh& mesh);
/// For each vertex, its own index.
[[nodiscard]] std::vector<std::uint32_t> own_ids(const Mesh& mesh);

/// A side of a triangle: from the vertex of its corner to the vertex of the next corner.
struct Side {
  std::uint64_t edge;      // lower vertex << 32 | higher vertex
  std::uint32_t triangle;  // index of the triangle
  std::uint32_t corner;    // 0 to 2
};
/// All sides, grouped by edge and sorted by triangle.
[[nodiscard]] std::vector<Side> sides_by_edge(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id);

/// Calls `visit(first, last)` for the sides of each edge.
template <class Visit>
void for_each_edge(const std::vector<Side>& sides, const Visit& visit) {
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].edge == sides[begin].edge) ++end;
    visit(begin, end);
  }
}

/// Edge of the border from `from` to `to`, with the surface on its left.
struct BoundaryEdge {
  std::uint32_t from, to;
};
[[nodiscard]] std::vector<BoundaryEdge> boundary_edges(const Mesh& mesh, const std::vector<Side>& sides);

/// Fans: sets of triangles at a vertex, connected by sides at this vertex. A manifold has a single fan per vertex.
struct Fans {
  std::vector<std::uint32_t> of_corner;       // fan index, by 3 * triangle + corner
  std::unordered_set<std::uint32_t> several;  // vertices with several fans
};
/// `sides`: a side shared by more than two triangles connects all of them.
[[nodiscard]] Fans fans_of(const Mesh& mesh, const std::vector<Side>& sides,
                           const std::vector<std::uint32_t>& vertex_id);

/// Connected components by shared vertices, for each triangle; numbered from 0 in the order of their first triangles.
struct Components {
  std::vector<std::uint32_t> of_triangle;
  std::uint32_t count = 0;
};
[[nodiscard]] Components connected_components(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id);

/// Concatenates parts, without textures; normals and colors only if all parts have them.
[[nodiscard]] Mesh joined(const std::vector<Mesh>& parts);
/// Concatenates parts and merges vertices at identical positions, keeping the attributes of the first. Drops triangles
/// that become degenerate.
[[nodiscard]] Mesh welded(const std::vector<Mesh>& parts);

}  // namespace cairn
