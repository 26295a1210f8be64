// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What is known of a map's bricks while its grids are written.
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

/// Which voxels of a brick are known, and which lie behind the surface, see with_unknown.
struct GridBrick {
  std::array<int, 3> brick{};
  BrickBits known{}, behind{};
  [[nodiscard]] Brick at() const { return {brick[0], brick[1], brick[2]}; }
};

/// The bricks of a map's grids, on the disk: a city's do not fit into memory.
class GridBricks {
 public:
  /// On the disk that `file` will be on.
  explicit GridBricks(const std::filesystem::path& file) : spool_(file) {}
  /// They come in the order of the grids, see before_in_grid.
  void append(std::span<const GridBrick> bricks);
  /// All that were appended, until more are.
  [[nodiscard]] std::span<const GridBrick> all();

  /// One mask of the bricks from `begin` to `end`, and behind these that of the other bricks at `steps` from one of
  /// them, each once.
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
  std::span<const GridBrick> all_;                     // as mapped, perhaps before the last were appended
  std::unordered_map<Brick, Range, BrickHash> cubes_;  // of kCube bricks a side: where theirs are
};

}  // namespace cairn
