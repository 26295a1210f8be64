// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/staging_folder.hpp"

namespace cairn {

/// Folder of the tiles of X.json: X.tiles/CHECKSUM/. Tiles of the previous tileset stay until the tileset names the new
/// ones, so that it is complete at every moment; the destructor removes an unfinished folder.
class TilesFolder {
 public:
  /// Throws std::runtime_error if the folder cannot be made.
  explicit TilesFolder(const std::filesystem::path& tileset);
  ~TilesFolder();
  TilesFolder(const TilesFolder&) = delete;
  TilesFolder& operator=(const TilesFolder&) = delete;

  /// Folder into which tiles are written.
  [[nodiscard]] const std::filesystem::path& part() const { return part_; }
  /// Renames the folder after all tiles are written. Returns its URL relative to the tileset.
  [[nodiscard]] std::string finish();
  /// Call when the tileset names the folder. Keeps the folder, and removes tiles of previous tilesets, recognized by
  /// their checksum.
  void keep();
  /// Sorted by name.
  [[nodiscard]] std::vector<std::filesystem::path> files() const;

 private:
  std::filesystem::path home_, part_;  // part_: the finished folder in the end
  bool created_home_ = false;
  std::unique_ptr<StagingFolder> staging_;  // until finished
  bool owns_part_ = false;                  // the destructor removes part_
};

}  // namespace cairn
