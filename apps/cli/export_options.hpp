// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <CLI/CLI.hpp>
#include <functional>

#include "cairn/mapping/export.hpp"
#include "cairn/mapping/map.hpp"

namespace cairn::apps {

/// Mesh options of the command line. A mesh with color gets a texture unless --no-texture is set.
struct MeshArguments : ExportOptions {
  bool texture_requested = false;  // by --texture, or by an option that only textures have
  bool no_texture = false;
  /// Options for a file: with a texture if its format supports textures or if requested.
  [[nodiscard]] ExportOptions for_file(const std::filesystem::path& file) const;
};

/// Adds the options shared by `export`, `reconstruct`, `live` and `merge`. The arguments are valid after parsing.
void add_export_options(CLI::App& command, MeshArguments& arguments);

/// Adds --up, for commands that read an existing map.
void add_up(CLI::App& command, std::optional<Up>& up);

/// Calls `write` with the options for `file`; without a texture if the map has no color and no texture was requested.
[[nodiscard]] ExportReport with_texture_if_any(const MeshArguments& arguments, const std::filesystem::path& file,
                                               const std::function<ExportReport(const ExportOptions&)>& write);

/// Writes a map's mesh; without a texture if the map has no color and no texture was requested. Throws like
/// Map::export_mesh.
ExportReport export_mesh(Map map, const std::filesystem::path& file, const MeshArguments& arguments,
                         const ExportProgress& progress);

}  // namespace cairn::apps
