// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Sources of each cell of a map merged from several maps: PLAN/cells/X,Y,Z.json.
#pragma once
#include <array>
#include <filesystem>
#include <vector>

#include "export/map_contents.hpp"
#include "multisession/session_merger.hpp"

namespace cairn {

using CellName = std::array<int, 3>;

[[nodiscard]] std::filesystem::path cell_file(const std::filesystem::path& plan, const CellName& cell);
[[nodiscard]] std::filesystem::path cell_folder(const std::filesystem::path& plan, const CellName& cell);
/// Path of a file written by `cairn tile` for the cell. Throws std::runtime_error with the command to run if the file
/// is missing.
[[nodiscard]] std::filesystem::path file_of_cell(const std::filesystem::path& plan, const CellName& cell,
                                                 const char* name);

struct WrittenCells {
  int cells = 0, changed = 0;
};
/// Writes a file for each cell that `map` reaches and removes the files of cells out of reach; unchanged files stay
/// untouched. `maps`: sources of `map`.
WrittenCells write_cells(const std::filesystem::path& plan, MapState& map, const std::vector<SessionMerger::Map>& maps);

/// Throws std::runtime_error if the cell does not exist or its file does not match the map in PLAN/session.
[[nodiscard]] MapBlock read_cell(const std::filesystem::path& plan, const CellName& cell,
                                 const std::vector<SourceMapFiles>& source_maps);

}  // namespace cairn
