// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A mesh is cut into charts that lie flat side by side in a texture.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/mesh.hpp"
#include "mesh/topology.hpp"
#include "shaders/texture.h"

namespace cairn {

/// A part of a mesh and its projection to a plane, in which no two triangles overlap.
struct Chart {
  std::vector<std::uint32_t> triangles;
  Eigen::Matrix<float, 2, 3> plane;  // from a point to texels
  Eigen::Vector2f low, high;         // of its vertices there
};

/// Grows charts from the flattest triangles as far as the surface does not turn away (Sander et al. 2003). `texel`:
/// metres; `max_size`: texels a side.
[[nodiscard]] std::vector<Chart> make_charts(const Mesh& mesh, float texel, int max_size);

/// Charts side by side in a texture.
struct TextureAtlas {
  struct Tile {
    int x = 0, y = 0;  // of its first texel, in the texture
    /// The triangle under each texel, row by row: its number in `mesh`, or kNone.
    std::array<std::uint32_t, shader::kTileTexels> triangles{};
  };

  Mesh mesh;  // a vertex for each chart that it belongs to, with texture_coordinates; its texture has a size and no
              // texels
  int charts = 0;
  std::vector<Tile> tiles;  // of charts that lie under some texel

  /// The point of the surface under a tile's texel, or beside it in the plane of its triangle; `normal` is 0 where
  /// there is none.
  [[nodiscard]] shader::Texel point(const Tile& tile, std::size_t k) const;
  /// The number of a tile's texel in the texture.
  [[nodiscard]] std::size_t texel(const Tile& tile, std::size_t k) const;
};
/// Packs charts. Nothing where they do not fit into a texture of `max_size` a side.
[[nodiscard]] std::optional<TextureAtlas> pack(const Mesh& mesh, const std::vector<Chart>& charts, int max_size);

/// Gives texels between charts colours that go smoothly from one to the next, so that neither filters nor JPEG bleed.
void fill_between(Texture& texture, std::vector<bool> known);

}  // namespace cairn
