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

namespace cairn {

/// A submap's file.
[[nodiscard]] std::filesystem::path submap_file(const NumberedFiles& files, std::size_t submap);

/// Ended submaps: parts of the map that no longer change, each what was fused while its keyframes were taken. With a
/// folder each is a file there, and those used longest ago leave the memory when they need more than the budget, to be
/// read by parts from then on.
class Submaps {
 public:
  /// `budget`: bytes; 0: 16 MiB. Without the right to write, what is added stays in memory.
  Submaps(NumberedFiles files, std::uint64_t budget, Access access);
  void add(BrickList voxels);
  /// Adds one whose file is there already, or, if it has none, a dropped one. Another map's file is opened once it is
  /// needed.
  void add_stored(bool has_file);
  /// A submap's voxels, to be added elsewhere.
  [[nodiscard]] BrickList copy(std::size_t i) const;
  /// Forgets a submap's voxels; the others keep their numbers, and its file stays: a checkpoint may name it.
  void drop(std::size_t i);
  /// All that are in files leave the memory.
  void leave_memory();
  [[nodiscard]] std::size_t size() const { return bricks_.size(); }
  /// Not so for a dropped submap.
  [[nodiscard]] bool has_voxels(std::size_t i) const { return bricks_[i] == nullptr || !bricks_[i]->empty(); }
  /// Those with voxels. Throws std::runtime_error for a file that is missing or broken.
  [[nodiscard]] const std::shared_ptr<const BrickSet>& bricks(std::size_t i) const;
  /// A submap's voxels; of those that have left the memory the ones in a box, from its file.
  [[nodiscard]] std::shared_ptr<const BrickTree> voxels(std::size_t i, const BrickBox& box);
  /// A submap with all that it knows to be free, and perhaps its voxels.
  [[nodiscard]] std::shared_ptr<const BrickTree> free(std::size_t i);
  /// Brings all that was added into files. Returns why some could not be written, which stay in memory, or nothing.
  [[nodiscard]] std::optional<std::string> store();
  [[nodiscard]] std::filesystem::path file(std::size_t i) const;

  struct Counts {
    std::uint64_t peak_bytes = 0, read_back = 0;
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

 private:
  /// How the newest was written, and its voxels where they stay in memory.
  struct Written {
    bool stored = false;
    std::shared_ptr<const BrickTree> voxels;
  };
  void wait();
  void keep_within_budget(std::uint64_t being_written = 0);
  NumberedFiles files_;
  std::uint64_t budget_;
  bool writes_;
  [[nodiscard]] const BrickFile& opened(std::size_t i);
  mutable std::vector<std::shared_ptr<const BrickSet>> bricks_;  // null: not yet asked for
  std::vector<std::shared_ptr<const BrickTree>> voxels_;         // null: in its file alone
  std::map<std::size_t, BrickFile> open_;                        // of those that were read from last
  std::vector<std::uint64_t> last_use_;
  std::uint64_t use_ = 0;
  std::vector<bool> stored_;      // in their files
  std::future<Written> writing_;  // of the newest
  Counts counts_;
};

}  // namespace cairn
