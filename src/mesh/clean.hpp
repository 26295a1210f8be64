// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <cstdint>
#include <functional>

#include "cairn/export.hpp"
#include "cairn/mesh.hpp"

namespace cairn {

struct Cleaned {
  std::size_t components_removed = 0, holes_filled = 0;
};

/// Whether a triangle of the mesh is this one's to count, of those that see the same surface.
using CountsTriangle = std::function<bool(const std::array<std::uint32_t, 3>&)>;

/// Removes what is no surface: triangles without area, what make_manifold removes, spikes on borders, floating pieces,
/// what was seen too little; fills small holes; makes borders smooth. What was decided at a place depends on what lies
/// around it no farther than the larger of CleanOptions::fill_holes and three pieces. `counts`: a piece or a hole is
/// counted where one of its triangles, which is always the same, is; none: all are.
Cleaned clean(Mesh& mesh, const CleanOptions& options, const CountsTriangle& counts = {});

struct ManifoldOptions {
  /// Vertices at which all fans stay, since others have triangles there that may join them; none: there are no others.
  std::function<bool(std::uint32_t)> fixed;
  bool keep_sheets = false;  ///< two triangles on each other that look apart stay
};

/// Leaves a surface that is a manifold with borders, also where vertices at the very same place are one. Removes
/// triangles without area; of triangles with the same three vertices both if they look apart, else all but one; of the
/// triangles at a side that more than two share the smallest; and at a vertex where several fans of triangles meet all
/// but the largest fan. Returns how many.
std::size_t make_manifold(Mesh& mesh, const ManifoldOptions& options = {});

}  // namespace cairn
