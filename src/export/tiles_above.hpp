// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Levels of detail above the cells of a tileset that are tilesets themselves.
#pragma once
#include <filesystem>
#include <vector>

#include "mesh/tiles.hpp"
#include "volume/volume.hpp"

namespace cairn {

struct CellTile {
  Brick cell;
  Tile tile;
  std::filesystem::path mesh;  // the coarsest one of it, a .glb
};

/// A tile around tiles whose cells lie near each other, and so on until there is one. Each shows its children's meshes
/// as one, with their colours at the vertices and a quarter of their triangles; what it shares with neighbours of its
/// own level stays, so that no crack opens between them. Their .glb files are written into `folder`, and named by
/// Tile::content as seen from there. There are two tiles or more.
[[nodiscard]] Tile tiles_above(std::vector<CellTile> tiles, const std::filesystem::path& folder);

}  // namespace cairn
