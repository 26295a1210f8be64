// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

namespace cairn::apps {

/// Whether a folder holds what reconstruct, live or merge has made, or has begun to make.
[[nodiscard]] bool holds_map(const std::filesystem::path& folder);
/// Prints how well the run went, how large the map is, and what is in its folder. Throws std::runtime_error for a
/// damaged report or session.
void print_map_info(const std::filesystem::path& folder, bool as_json);

}  // namespace cairn::apps
