// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

/// A tile of 3D Tiles 1.1 (OGC 22-025r4): a .glb that its children, with more detail, replace.
struct Tile {
  std::string content;      // its address as seen from tileset.json; empty: none
  Eigen::AlignedBox3f box;  // of what is in it and below, world frame
  double error = 0;         // metres by which its content is beside the surface
  std::vector<Tile> children;
};

/// Writes tileset.json, whole or not at all. Tilesets are z-up: what glTF calls -z is their y.
void write_tileset(const std::filesystem::path& file, const Tile& root);

}  // namespace cairn
