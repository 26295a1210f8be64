// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/export.hpp"
#include "cairn/mesh.hpp"

namespace cairn {

struct Cleaned {
  std::size_t components_removed = 0, holes_filled = 0;
};

/// Removes what is no surface: triangles without area, sides that more than two triangles share, spikes on borders,
/// floating pieces, what was seen too little; fills small holes; makes borders smooth. What was decided at a place
/// depends on what lies around it no farther than the larger of CleanOptions::fill_holes and three pieces.
Cleaned clean(Mesh& mesh, const CleanOptions& options);

/// Removes triangles without area, and of the triangles at a side that more than two share the smallest, until none is
/// left. Returns how many.
std::size_t make_manifold(Mesh& mesh);

}  // namespace cairn
