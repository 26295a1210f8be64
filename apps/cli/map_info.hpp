// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

namespace cairn::apps {

/// Returns true if a folder holds a complete or partial result of reconstruct, live or merge.
[[nodiscard]] bool is_map_folder(const std::filesystem::path& folder);
/// Prints the quality of the run, the size of the map and the files of its folder. Throws std::runtime_error for a
/// damaged report or session.
void print_map_info(const std::filesystem::path& folder, bool as_json);

}  // namespace cairn::apps
