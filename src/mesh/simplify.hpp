// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mapping/export_options.hpp"
#include "cairn/mapping/mesh.hpp"

namespace cairn {

struct Simplified {
  float error = 0;                  // meters, maximum displacement of the surface; the quadric error underestimates it
  std::vector<std::uint32_t> kept;  // vertices, in order
};

/// Simplifies by edge collapse (Garland & Heckbert 1997, meshoptimizer). Vertices keep their positions, borders are
/// straightened only within the error, and `locked` vertices are kept (empty: none). `keep_colors`: preserves edges
/// between regions of different colors like borders. The result has no side with more than two triangles.
/// SimplifyOptions::triangles is a hard limit: if necessary, colors, locked vertices and finally the shape itself are
/// not preserved.
Simplified simplify(Mesh& mesh, const SimplifyOptions& options, const std::vector<bool>& locked, bool keep_colors);

/// Regions of similar color, by triangle (Felzenszwalb & Huttenlocher 2004).
[[nodiscard]] std::vector<std::uint32_t> color_regions(const Mesh& mesh);

}  // namespace cairn
