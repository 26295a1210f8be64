// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>

namespace cairn {

/// What a file or folder is by its names, so that an error about one of the wrong kind says what to do with it.
struct PathKind {
  enum class Kind { recording, images_of_recording, map, part, plan, tiles, mesh, voxels, trajectory, empty, other };
  Kind kind = Kind::other;
  std::string words;   ///< "is a mesh", after the path
  std::string remedy;  ///< "`cairn view mesh.glb` shows it"; of another kind empty
  /// "PATH: is a mesh, no recording: `cairn view PATH` shows it". `wanted` is the kind that it is not: "recording".
  [[nodiscard]] std::string is_no(const std::filesystem::path& path, const std::string& wanted) const;
};

/// Looks at names alone, and opens no file.
[[nodiscard]] PathKind kind_of_path(const std::filesystem::path& path);

}  // namespace cairn
