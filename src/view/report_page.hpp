// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace cairn {

/// A mesh.glb of more bytes does not fit into the page; preview.glb beside it takes its place there.
constexpr std::uintmax_t kMaxInlineMesh = std::uintmax_t{64} << 20;

/// The viewer: one HTML file with all that it needs. It shows what is in an element `data` of it, or what `data.json`
/// beside it tells.
[[nodiscard]] std::string_view viewer_page();

/// What the page shows of a finished map, as JSON: report.json and trajectory.txt in `folder`, and its mesh by the name
/// mesh.glb. Throws std::runtime_error when the folder holds no map.
[[nodiscard]] std::string finished_data(const std::filesystem::path& folder);

/// Writes report.html in a folder with report.json, trajectory.txt and mesh.glb: a page that needs nothing else. For a
/// mesh that is too large preview.glb is shown, if there is one; else the page tells that it is left out. Whole or not
/// at all.
void write_report_page(const std::filesystem::path& folder);

}  // namespace cairn
