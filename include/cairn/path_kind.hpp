// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>

namespace cairn {

/// Kind of a file or folder, judged by names, so that an error about a wrong path can name the remedy.
struct PathKind {
  enum class Kind { recording, images_of_recording, map, part, plan, tiles, mesh, voxels, trajectory, empty, other };
  Kind kind = Kind::other;
  std::string words;   ///< "is a mesh", printed after the path
  std::string remedy;  ///< "`cairn view mesh.glb` shows it"; empty for some kinds
  /// "PATH: is a mesh, no recording: `cairn view PATH` shows it". `wanted`: expected kind, "recording".
  [[nodiscard]] std::string is_no(const std::filesystem::path& path, const std::string& wanted) const;
};

/// Detects the kind from names only; opens no file.
[[nodiscard]] PathKind kind_of_path(const std::filesystem::path& path);

}  // namespace cairn
