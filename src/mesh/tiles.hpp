// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/export_options.hpp"

namespace cairn {

/// A tile of 3D Tiles 1.1 (OGC 22-025r4): a .glb, replaced by its children at higher detail.
struct Tile {
  std::string content;      // URI relative to tileset.json; empty: none
  Eigen::AlignedBox3f box;  // bounds of its content and descendants, world frame
  double error = 0;         // geometric error: distance of its content from the surface, meters
  std::vector<Tile> children;
  bool is_tileset = false;  // the content is a tileset with its own children
};

/// Transform from the tileset's axes (z up, y forward) to the Earth's (WGS 84; x at latitude and longitude 0,
/// z north; meters).
[[nodiscard]] Eigen::Isometry3d earth_from_tileset(const GeoPlace& place);

/// Prefixes the content of a tile and its descendants with a folder, except tilesets, which have their own paths.
void put_into(Tile& tile, const std::string& folder);

/// A tileset written by write_tileset without geographic position, for use as the content of another tileset's tile.
struct TilesetFile {
  Tile root;                      // without content and children: it is a tileset
  std::filesystem::path content;  // the root's mesh; empty: none
};
/// Throws std::runtime_error if the file is not a tileset.
[[nodiscard]] TilesetFile read_tileset_file(const std::filesystem::path& file);

/// Writes tileset.json atomically. Tilesets are z-up: glTF's -z is their y. `place`: geographic position, stored in the
/// root's transform; none: local coordinates.
void write_tileset(const std::filesystem::path& file, const Tile& root, const std::optional<GeoPlace>& place = {});

}  // namespace cairn
