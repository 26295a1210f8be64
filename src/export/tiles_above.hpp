// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Levels of detail above cells of a tileset; each cell's content is a tileset.
#pragma once
#include <filesystem>
#include <vector>

#include "mesh/tiles.hpp"
#include "volume/volume.hpp"

namespace cairn {

struct CellTile {
  Brick cell;
  Tile tile;
  std::filesystem::path mesh;  // coarsest mesh of the tile, a .glb
};

/// Builds parent tiles around neighboring tiles up to a single root. Each parent shows its children's meshes merged,
/// with vertex colors and a quarter of their triangles; vertices shared with neighbors of the same level stay fixed, so
/// that no crack opens. Writes the .glb files into `folder`; Tile::content is relative to it. Requires two tiles or
/// more.
[[nodiscard]] Tile tiles_above(std::vector<CellTile> tiles, const std::filesystem::path& folder);

}  // namespace cairn
