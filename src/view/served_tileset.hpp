// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// 3D Tiles for the web page. Files are registered as tilesets are requested, so that the number of tiles does not
// matter.
#pragma once
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "net/served.hpp"

namespace cairn {

/// Adds files to a server; thread-safe.
using AddFiles = std::function<void(std::map<std::string, Served>&&)>;

/// Tileset of `map`: the file itself, or the tileset of a plan folder. Empty for any other path. Throws
/// std::runtime_error with a remedy for a plan without tiles.
[[nodiscard]] std::optional<std::filesystem::path> tileset_of(const std::filesystem::path& map);

/// `data.json` and the root tileset. Each request of a tileset passes the .glb files and tilesets it references to
/// `add`, restricted to the folder of `tileset` and below. Throws std::runtime_error for a file that is not a tileset.
[[nodiscard]] std::map<std::string, Served> served_tileset(const std::filesystem::path& tileset, AddFiles add);

}  // namespace cairn
