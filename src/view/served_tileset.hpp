// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a page shows of 3D Tiles: however many there are, those that it has come to are known.
#pragma once
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "view/served.hpp"

namespace cairn {

/// Gives a server more files, from any thread.
using AddFiles = std::function<void(std::map<std::string, Served>&&)>;

/// The tileset that `map` is: itself, or that of the plan in this folder. Nothing for what is something else. Throws
/// std::runtime_error for a plan without tiles, with what to do.
[[nodiscard]] std::optional<std::filesystem::path> tileset_of(const std::filesystem::path& map);

/// `data.json` and the tileset that it names. Each time that a tileset is asked for, the .glb and further tilesets that
/// it refers to go to `add`: those in the folder of `tileset` and below alone. Throws std::runtime_error for what is no
/// tileset.
[[nodiscard]] std::map<std::string, Served> served_tileset(const std::filesystem::path& tileset, AddFiles add);

}  // namespace cairn
