// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/staging_folder.hpp"

namespace cairn {

/// Where the tiles of X.json lie: X.tiles/CHECKSUM/. The tiles that the tileset has had until then stay until it names
/// the new ones, so that it is whole at every moment; a part that was not finished goes away with the object.
class TilesFolder {
 public:
  /// Throws std::runtime_error where there can be no such folder.
  explicit TilesFolder(const std::filesystem::path& tileset);
  ~TilesFolder();
  TilesFolder(const TilesFolder&) = delete;
  TilesFolder& operator=(const TilesFolder&) = delete;

  /// Tiles are written into this.
  [[nodiscard]] const std::filesystem::path& part() const { return part_; }
  /// All are written: the folder gets its name. Returns its address as the tileset has it.
  [[nodiscard]] std::string finish();
  /// The tileset names it: it stays, and the tiles that tilesets had there before are removed, known by their checksum.
  void keep();
  /// In order of their names.
  [[nodiscard]] std::vector<std::filesystem::path> files() const;

 private:
  std::filesystem::path home_, part_;  // part_: the finished folder in the end
  bool made_home_ = false;
  std::unique_ptr<StagingFolder> staging_;  // until it is finished
  bool is_mine_ = false;                    // part_ goes away with the object
};

}  // namespace cairn
