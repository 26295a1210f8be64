// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Charts of a mesh: flat parts, packed side by side in a texture.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "mesh/topology.hpp"
#include "shaders/texture.h"

namespace cairn {

/// Part of a mesh with a projection to a plane without overlapping triangles.
struct Chart {
  std::vector<std::uint32_t> triangles;
  Eigen::Matrix<float, 2, 3> plane;  // from a point to texels
  Eigen::Vector2f low, high;         // bounds of its projected vertices
};

/// Grows charts from the flattest triangles until the surface turns away (Sander et al. 2003). `texels`: wanted size of
/// a texel by vertex, meters; the texels of a chart have the lower quartile of its vertices. `max_size`: texels per
/// side.
[[nodiscard]] std::vector<Chart> make_charts(const Mesh& mesh, std::span<const float> texels, int max_size);

/// Charts packed in a texture.
struct TextureAtlas {
  struct Tile {
    int x = 0, y = 0;  // first texel in the texture
    /// Triangle at each texel, row by row: index in `mesh`, or kNone.
    std::array<std::uint32_t, shader::kTileTexels> triangles{};
  };

  Mesh mesh;  // with texture_coordinates and a separate vertex per chart; its texture has a size but no texels
  int charts = 0;
  std::vector<Tile> tiles;  // tiles with a chart in at least one texel

  /// Surface point at a tile's texel, extrapolated in the plane of its triangle for padding; `normal` is 0 for an empty
  /// texel.
  [[nodiscard]] shader::Texel point(const Tile& tile, std::size_t k) const;
  /// Index of a tile's texel in the texture.
  [[nodiscard]] std::size_t texel(const Tile& tile, std::size_t k) const;
};
/// Packs charts. Returns no value if they do not fit into a texture of `max_size` per side.
[[nodiscard]] std::optional<TextureAtlas> pack(const Mesh& mesh, const std::vector<Chart>& charts, int max_size);

/// Fills texels between charts with smooth colors, which avoids bleeding by filters and JPEG.
void fill_between(Texture& texture, std::vector<bool> known);

}  // namespace cairn
