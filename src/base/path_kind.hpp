// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>

namespace cairn {

/// Kind of a file or folder, judged by names, for the remedy in an error about a wrong path.
struct PathKind {
  enum class Kind { recording, images_of_recording, map, part, plan, tiles, mesh, voxels, trajectory, empty, other };
  Kind kind = Kind::other;
  std::string words;   ///< "is a mesh", printed after the path
  std::string remedy;  ///< "`cairn view mesh.glb` shows it"; empty for some kinds
  /// "PATH: is a mesh, not a recording: `cairn view PATH` shows it". `expected`: expected kind, "recording".
  [[nodiscard]] std::string mismatch(const std::filesystem::path& path, const std::string& expected) const;
};

/// Detects the kind from names only; opens no file.
[[nodiscard]] PathKind kind_of_path(const std::filesystem::path& path);

}  // namespace cairn
