// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Partition of a map into cells for export.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "cairn/mapping/export.hpp"
#include "cairn/mapping/mesh.hpp"
#include "volume/volume.hpp"

namespace cairn {

/// Divides the map's bricks into cubes of some bricks a side, counted from the lowest brick, or puts all into a single
/// cell.
class Cells {
 public:
  using Key = std::array<int, 3>;
  /// `brick_size`: meters. `as_tiles`: cells of a tileset, also for a small map. `block`: a single block of kBlockSide
  /// bricks a side; its cells are 0 to 3 on each axis, and surrounding cells have indices outside this range.
  Cells(const std::vector<Brick>& bricks, float brick_size, bool as_tiles, const ExportOptions& options,
        const std::optional<Brick>& block = {});
  /// Unit of export of a map larger than the memory, with its levels of detail.
  static constexpr int kBlockLevels = 2, kBlockSide = 32 << kBlockLevels;  // bricks
  /// Bricks of a block.
  [[nodiscard]] static Eigen::AlignedBox3i box_of(const Brick& block) {
    return {block * kBlockSide, (block + Brick::Ones()) * kBlockSide - Brick::Ones()};
  }
  /// Margin of bricks around a cell with influence on its surface.
  [[nodiscard]] static int margin(const CleanOptions& clean, float brick_size);

  /// True if a single cell has all bricks.
  [[nodiscard]] bool is_single() const { return side_ == 0; }
  /// Non-empty cells with their bricks.
  [[nodiscard]] const std::map<Key, std::vector<Brick>>& all() const { return cells_; }
  /// Bricks of a cell and of its neighborhood, so that decisions at a border are the same on both sides.
  [[nodiscard]] std::vector<Brick> around(const Key& cell) const;
  /// Cell of a triangle.
  [[nodiscard]] Brick owner(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle) const;
  [[nodiscard]] bool is_own(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle, const Key& cell) const {
    return is_single() || key(owner(mesh, triangle)) == cell;
  }

  [[nodiscard]] static Key key(const Brick& b) { return {b.x(), b.y(), b.z()}; }
  [[nodiscard]] static Brick brick(const Key& k) { return {k[0], k[1], k[2]}; }
  /// Parent cell at a level of an octree over the cells.
  [[nodiscard]] static Brick at_level(const Brick& cell, int level) {
    return cell.unaryExpr([level](int i) { return i >> level; });
  }

 private:
  int side_ = 0, margin_ = 0;     // bricks; 0: a single cell
  float side_length_ = 0;         // meters
  Brick origin_ = Brick::Zero();  // cells are counted from here, so that a single root cell contains all
  std::map<Key, std::vector<Brick>> cells_;
};

}  // namespace cairn
