// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <cstdint>
#include <functional>

#include "cairn/mapping/export_options.hpp"
#include "cairn/mapping/mesh.hpp"

namespace cairn {

struct Cleaned {
  std::size_t components_removed = 0, holes_filled = 0;
};

/// True if this mesh counts the triangle, when several meshes contain the same surface.
using CountsTriangle = std::function<bool(const std::array<std::uint32_t, 3>&)>;

/// Removes artifacts: triangles without area, the triangles removed by make_manifold, spikes on borders, floating
/// components, and surfaces with too few observations. Then fills small holes and smooths borders. The result at a
/// point depends only on its surroundings up to the larger of CleanOptions::fill_holes and three times the minimum size
/// of a component. `counts`: a component or hole is counted if it accepts a representative triangle, independent of the
/// vertex numbering; none: counts all.
Cleaned clean(Mesh& mesh, const CleanOptions& options, const CountsTriangle& counts = {});

struct ManifoldOptions {
  /// Vertices at which all fans are kept, since other meshes may have triangles there that connect them; none: no such
  /// vertices.
  std::function<bool(std::uint32_t)> fixed;
  bool keep_sheets = false;  ///< keeps opposite triangles with the same vertices
};

/// Makes the surface a manifold with borders, treating vertices at identical positions as one. Removes triangles
/// without area; of coincident triangles both if they are opposite, else all but one; the smallest triangles at a side
/// shared by more than two; and all but the largest fan at a vertex with several fans. Returns the number of removed
/// triangles.
std::size_t make_manifold(Mesh& mesh, const ManifoldOptions& options = {});

}  // namespace cairn
