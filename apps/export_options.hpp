// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <CLI/CLI.hpp>
#include <functional>

#include "cairn/export.hpp"
#include "cairn/map.hpp"

namespace cairn::apps {

/// How a mesh is written, as the command line says. A texture is made wherever there is colour, unless --no-texture.
struct MeshArguments : ExportOptions {
  bool asks_for_texture = false;  // by --texture, or by an option that only a texture has
  bool no_texture = false;
  /// With a texture where such a file can have one, or where it was asked for.
  [[nodiscard]] ExportOptions for_file(const std::filesystem::path& file) const;
};

/// What `export`, `reconstruct`, `live` and `merge` share. The arguments hold once the command line is read.
void add_export_options(CLI::App& command, MeshArguments& arguments);

/// --up for what is made from a map that is there.
void add_up(CLI::App& command, std::optional<Up>& up);

/// Calls `write` with what the arguments say of such a file, and without a texture where the map has no colour and none
/// was asked for.
[[nodiscard]] Exported with_texture_if_any(const MeshArguments& arguments, const std::filesystem::path& file,
                                           const std::function<Exported(const ExportOptions&)>& write);

/// Writes a map's mesh. Where the map has no colour and no texture was asked for, it has none. Throws as
/// Map::export_mesh does.
Exported export_mesh(Map map, const std::filesystem::path& file, const MeshArguments& arguments,
                     const ExportProgress& progress);

}  // namespace cairn::apps
