// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/export.hpp"

namespace cairn {

/// A tile of 3D Tiles 1.1 (OGC 22-025r4): a .glb that its children, with more detail, replace.
struct Tile {
  std::string content;      // its address as seen from tileset.json; empty: none
  Eigen::AlignedBox3f box;  // of what is in it and below, world frame
  double error = 0;         // metres by which its content is beside the surface
  std::vector<Tile> children;
  bool is_tileset = false;  // content: it has children of its own
};

/// From a tileset's axes (z up, y forward) to the Earth's (WGS 84; x at latitude and longitude 0, z north; metres).
[[nodiscard]] Eigen::Isometry3d earth_from_tileset(const GeoPlace& place);

/// Tells that the meshes of a tile and of those below it lie in a folder; not those of tilesets, which lie elsewhere.
void put_into(Tile& tile, const std::string& folder);

/// A tileset that write_tileset has made, without a place on the Earth, to be the content of a tile of another one.
struct TilesetFile {
  Tile root;                      // without content and children: it is a tileset
  std::filesystem::path content;  // the root's mesh; empty: it has none
};
/// Throws std::runtime_error for what is none.
[[nodiscard]] TilesetFile read_tileset_file(const std::filesystem::path& file);

/// Writes tileset.json, whole or not at all. Tilesets are z-up: what glTF calls -z is their y. `place`: where globes
/// show it, by the root's transform; none: around their own origin.
void write_tileset(const std::filesystem::path& file, const Tile& root, const std::optional<GeoPlace>& place = {});

}  // namespace cairn
