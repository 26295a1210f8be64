// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The cells that a map is exported by.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "cairn/export.hpp"
#include "cairn/mesh.hpp"
#include "volume/volume.hpp"

namespace cairn {

/// The map's bricks in cubes of some bricks a side, counted from the lowest of them; or all in one cell.
class Cells {
 public:
  using Key = std::array<int, 3>;
  /// `brick_size`: metres. `as_tiles`: cells of a tileset, also where the map is small. `block`: of a part of a map
  /// alone, which is counted in blocks of kBlockSide bricks; its cells are 0 to 3, and those around it lie around them.
  Cells(const std::vector<Brick>& bricks, float brick_size, bool as_tiles, const ExportOptions& options,
        const std::optional<Brick>& block = {});
  /// What is made at once of a map that is larger than a machine, and the levels of detail in it.
  static constexpr int kBlockLevels = 2, kBlockSide = 32 << kBlockLevels;  // bricks
  /// The bricks of a block.
  [[nodiscard]] static Eigen::AlignedBox3i box_of(const Brick& block) {
    return {block * kBlockSide, (block + Brick::Ones()) * kBlockSide - Brick::Ones()};
  }
  /// Bricks around a cell that tell what is made of its surface.
  [[nodiscard]] static int margin(const CleanOptions& clean, float brick_size);

  /// Whether all is one cell.
  [[nodiscard]] bool is_whole() const { return side_ == 0; }
  /// The cells that have bricks, with these.
  [[nodiscard]] const std::map<Key, std::vector<Brick>>& all() const { return cells_; }
  /// The bricks of a cell and of its neighbourhood, so that what is decided at its border is decided alike on both
  /// sides.
  [[nodiscard]] std::vector<Brick> around(const Key& cell) const;
  /// The cell that a triangle belongs to.
  [[nodiscard]] Brick owner(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle) const;
  [[nodiscard]] bool is_own(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle, const Key& cell) const {
    return is_whole() || key(owner(mesh, triangle)) == cell;
  }

  [[nodiscard]] static Key key(const Brick& b) { return {b.x(), b.y(), b.z()}; }
  [[nodiscard]] static Brick brick(const Key& k) { return {k[0], k[1], k[2]}; }
  /// The cell of a level of an octree over the cells that one of them is in.
  [[nodiscard]] static Brick at_level(const Brick& cell, int level) {
    return cell.unaryExpr([level](int i) { return i >> level; });
  }

 private:
  int side_ = 0, margin_ = 0;     // bricks; 0: all is one cell
  float side_length_ = 0;         // metres
  Brick origin_ = Brick::Zero();  // cells are counted from here, so that there is one around all of them
  std::map<Key, std::vector<Brick>> cells_;
};

}  // namespace cairn
