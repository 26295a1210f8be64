// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Connectivity of triangles.
#pragma once
#include <cstdint>
#include <span>
#include <tuple>
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

  friend bool operator<(const Side& a, const Side& b) {
    return std::tie(a.edge, a.triangle, a.corner) < std::tie(b.edge, b.triangle, b.corner);
  }
};
/// `corner`: 0 to 2.
[[nodiscard]] Side side_of(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id, std::uint32_t triangle,
                           std::uint32_t corner);
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

/// Corners of the triangles at each vertex, as 3 * triangle + corner, ascending.
class CornersByVertex {
 public:
  CornersByVertex(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id);
  [[nodiscard]] std::span<const std::uint32_t> at(std::size_t vertex) const {
    const std::uint32_t begin = vertex == 0 ? 0 : end_[vertex - 1];
    return {corners_.data() + begin, end_[vertex] - begin};
  }

 private:
  std::vector<std::uint32_t> end_, corners_;
};

/// Sides of these corners' triangles at a vertex whose other vertex is not lower, sorted. Over all vertices that is
/// each side once. Replaces `sides`.
void sides_at(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id, std::uint32_t vertex,
              std::span<const std::uint32_t> corners, std::vector<Side>& sides);
/// Sides of border edges, sorted.
[[nodiscard]] std::vector<Side> border_sides(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id,
                                             const CornersByVertex& corners);

/// Fans: sets of triangles at a vertex, connected by sides at this vertex; a side shared by more than two triangles
/// connects all of them. A manifold has a single fan per vertex. Returns for each corner of the vertex the index of the
/// first corner of its fan.
[[nodiscard]] std::vector<std::uint32_t> fans_at(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id,
                                                 std::span<const std::uint32_t> corners);
/// True for corners of a vertex in more than one fan.
[[nodiscard]] bool are_several_fans(const Mesh& mesh, const std::vector<std::uint32_t>& vertex_id,
                                    std::span<const std::uint32_t> corners);
/// Vertices with several fans, ascending.
[[nodiscard]] std::vector<std::uint32_t> vertices_with_several_fans(const Mesh& mesh,
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
