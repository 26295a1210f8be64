// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/export.hpp"
#include "cairn/mesh.hpp"

namespace cairn {

struct Simplified {
  float error = 0;                  // metres, how far the surface may have moved; quadrics tell a part of it
  std::vector<std::uint32_t> kept;  // vertices, in their order
};

/// Fewer triangles by collapsing edges (Garland & Heckbert 1997, meshoptimizer). Vertices stay where they are, borders
/// become straight only within the error, `locked` vertices stay (empty: none). `keep_colours`: edges between regions
/// of different colours stay where they are, as borders do. The result has no side with more than two triangles.
/// SimplifyOptions::triangles holds whatever it takes: where a mesh cannot have so few otherwise, colours, locked
/// vertices and in the end the shape itself are not kept.
Simplified simplify(Mesh& mesh, const SimplifyOptions& options, const std::vector<bool>& locked, bool keep_colours);

/// Regions of one colour, by triangle (Felzenszwalb & Huttenlocher 2004).
[[nodiscard]] std::vector<std::uint32_t> colour_regions(const Mesh& mesh);

}  // namespace cairn
