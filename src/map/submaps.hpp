// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <vector>

#include "map/keyframe.hpp"
#include "volume/brick_set.hpp"
#include "volume/vdb/brick_file.hpp"

namespace cairn {

/// Path of a submap's file.
[[nodiscard]] std::filesystem::path submap_file(const NumberedFiles& files, std::size_t submap);

/// Ended submaps: immutable parts of the map, each fused while its keyframes were taken. With a folder, each has a
/// file; the least recently used submaps leave memory beyond the budget and are then read in parts.
class Submaps {
 public:
  /// `budget`: bytes; 0: 16 MiB. Without write access, added submaps stay in memory.
  Submaps(NumberedFiles files, std::uint64_t budget, Access access);
  void add(BrickList voxels);
  /// Adds a submap with an existing file, or a dropped submap if it has none. Files of other maps are opened on demand.
  void add_stored(bool has_file);
  /// Drops a submap's voxels. The numbering stays, and so does the file: a checkpoint may refer to it.
  void drop(std::size_t i);
  /// Releases all submaps with files from memory.
  void release_memory();
  [[nodiscard]] std::size_t size() const { return bricks_.size(); }
  /// False for a dropped submap.
  [[nodiscard]] bool has_voxels(std::size_t i) const { return bricks_[i] == nullptr || !bricks_[i]->empty(); }
  /// Bricks with voxels. Throws std::runtime_error if the file is missing or broken.
  [[nodiscard]] const std::shared_ptr<const BrickSet>& bricks(std::size_t i) const;
  /// Voxels of a submap; if not in memory, those in the box, read from the file.
  [[nodiscard]] std::shared_ptr<const BrickTree> voxels(std::size_t i, const BrickBox& box);
  /// All free space of a submap; the tree may contain its voxels, too.
  [[nodiscard]] std::shared_ptr<const BrickTree> free_space(std::size_t i);
  /// Writes all added submaps to files. Returns the reason if some could not be written; these stay in memory.
  [[nodiscard]] std::optional<std::string> store();
  [[nodiscard]] std::filesystem::path file(std::size_t i) const;

  struct Counts {
    std::uint64_t peak_bytes = 0, read_back = 0;
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  /// Result of writing the newest submap, with its voxels if they stay in memory.
  struct Written {
    bool stored = false;
    std::shared_ptr<const BrickTree> voxels;
  };
  void wait();
  void keep_within_budget(std::uint64_t being_written = 0);
  NumberedFiles files_;
  std::uint64_t budget_;
  bool is_writable_;
  [[nodiscard]] const BrickFile& open_file(std::size_t i);
  mutable std::vector<std::shared_ptr<const BrickSet>> bricks_;  // null: not yet loaded
  std::vector<std::shared_ptr<const BrickTree>> voxels_;         // null: only in its file
  std::map<std::size_t, BrickFile> open_;                        // most recently read files
  std::vector<std::uint64_t> last_use_;
  std::uint64_t use_ = 0;
  std::vector<bool> stored_;      // true if in its file
  std::future<Written> writing_;  // of the newest submap
  Counts counts_;
};

}  // namespace cairn
