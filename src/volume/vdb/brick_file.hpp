// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Brick file: the bricks of a submap on disk, read at random.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "volume/vdb/brick_tree.hpp"

namespace cairn {

/// Writes bricks unchanged (a grid of 64-bit voxels, and a grid of free space): fast, for sessions. Atomic.
void write_bricks(const std::filesystem::path& file, const BrickTree& tree);
void write_bricks(const std::filesystem::path& file, const BrickList& list);

/// Random access to the bricks of a write_bricks file. Files from before 2026-11-24 have a single grid, with tiles for
/// completely free bricks.
class BrickFile {
 public:
  /// Reads the offsets of the bricks. Throws std::runtime_error if the file is missing or corrupt.
  explicit BrickFile(std::filesystem::path file);
  [[nodiscard]] std::vector<Eigen::Vector3i> bricks() const;  // sorted by x, then y, then z
  /// Throws std::runtime_error if voxels cannot be read.
  void check() const;
  /// Reads the complete file. Throws std::runtime_error as above, as do the functions below.
  [[nodiscard]] BrickTree read() const;
  /// Reads the bricks in a box; of free space, only completely free bricks.
  [[nodiscard]] BrickTree read(const BrickBox& box) const;
  /// Reads the free space, without voxels.
  [[nodiscard]] BrickTree read_free() const;

 private:
  struct Place {
    Eigen::Vector3i brick;
    std::int64_t offset;  // bytes from the start of the file
  };
  template <class Visit>
  void visit(const std::optional<BrickBox>& box, const Visit& visit) const;
  std::filesystem::path file_;
  std::uint32_t version_ = 0, compression_ = 0;  // of the OpenVDB format
  std::vector<Place> places_;                    // in file order
  std::vector<Eigen::Vector3i> free_;            // completely free bricks, sorted
  std::int64_t free_grid_ = 0;                   // bytes from the start of the file; 0: no free grid
};

}  // namespace cairn
