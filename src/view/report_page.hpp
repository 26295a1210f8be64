// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace cairn {

/// The viewer: one HTML file with all that it needs. It shows what is in an element `data` of it, or what `data.json`
/// beside it tells.
[[nodiscard]] std::string_view viewer_page();

/// What the page shows of a finished map, as JSON: report.json and trajectory.txt in `folder`, and its mesh by the name
/// mesh.glb. Throws std::runtime_error when the folder holds no map.
[[nodiscard]] std::string finished_data(const std::filesystem::path& folder);

}  // namespace cairn
