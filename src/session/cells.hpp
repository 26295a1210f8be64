// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What each cell of a map that is made of others is made of: PLAN/cells/X,Y,Z.json.
#pragma once
#include <array>
#include <filesystem>
#include <vector>

#include "export/map_contents.hpp"
#include "session/joined_session.hpp"

namespace cairn {

using CellName = std::array<int, 3>;

[[nodiscard]] std::filesystem::path cell_file(const std::filesystem::path& plan, const CellName& cell);
[[nodiscard]] std::filesystem::path cell_folder(const std::filesystem::path& plan, const CellName& cell);
/// A file there that `cairn tile` makes. Throws std::runtime_error with its command where it is missing.
[[nodiscard]] std::filesystem::path file_of_cell(const std::filesystem::path& plan, const CellName& cell,
                                                 const char* name);

struct WrittenCells {
  int cells = 0, changed = 0;
};
/// Writes a file for each cell that `map` reaches, and removes those that it does not reach any more; what would be as
/// it is stays untouched. `maps`: that it is made of.
WrittenCells write_cells(const std::filesystem::path& plan, MapState& map, const std::vector<JoinedSession::Map>& maps);

/// Throws std::runtime_error for a cell that there is not, or whose file is not of the map in PLAN/session.
[[nodiscard]] MapBlock read_cell(const std::filesystem::path& plan, const CellName& cell,
                                 const std::vector<PartFiles>& parts);

}  // namespace cairn
