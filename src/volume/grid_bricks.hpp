// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Brick masks of a map while its grids are written.
#pragma once
#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/spool.hpp"
#include "volume/volume.hpp"

namespace cairn {

/// Known voxels of a brick, and voxels behind the surface; see fill_unknown_signs.
struct GridBrick {
  std::array<int, 3> brick{};
  BrickBits known{}, behind{};
  [[nodiscard]] Brick at() const { return {brick[0], brick[1], brick[2]}; }
};

/// Brick masks of a map, stored on disk, because the masks of a city exceed the memory.
class GridBricks {
 public:
  /// Stores the masks on the same disk as `file`.
  explicit GridBricks(const std::filesystem::path& file) : spool_(file) {}
  /// Bricks must arrive in grid order; see before_in_grid.
  void append(std::span<const GridBrick> bricks);
  /// All bricks appended so far. Valid until the next append.
  [[nodiscard]] std::span<const GridBrick> all();

  /// Masks of the bricks from `begin` to `end`, followed by the masks of all other bricks at `steps` from any of these,
  /// without duplicates.
  [[nodiscard]] std::vector<std::pair<Brick, BrickBits>> with_around(std::size_t begin, std::size_t end,
                                                                     BrickBits GridBrick::*mask,
                                                                     std::span<const Brick> steps);

 private:
  struct Range {
    std::size_t begin = 0, end = 0;
  };
  [[nodiscard]] const GridBrick* find(std::span<const GridBrick> all, const Brick& brick) const;
  Spool spool_;
  std::size_t size_ = 0;
  std::span<const GridBrick> all_;                     // mapped view; may lack the latest bricks
  std::unordered_map<Brick, Range, BrickHash> cubes_;  // range of bricks by cube of kCube bricks per side
};

}  // namespace cairn
