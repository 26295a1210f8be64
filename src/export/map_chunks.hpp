// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Voxels of a map, loaded chunk by chunk for algorithms that never need all at once.
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "cairn/mapping/gravity_alignment.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

struct MapChunks {
  std::vector<Brick> bricks;                         // of the entire map, sorted
  Volume& volume;                                    // of the entire map, or of the bricks loaded last
  std::function<void(std::span<const Brick>)> load;  // loads bricks in place of the previous ones; empty: all are
                                                     // loaded
  Polygonizer& polygonizer;
  const BrickTree& free;     // observed free space
  GravityAlignment upright;  // rotation into the written world

  [[nodiscard]] float voxel_size() const { return volume.options().voxel_size; }
  /// Loads the bricks of a chunk that the map has, and their neighbors.
  void load_around(const std::vector<Brick>& chunk) const;
};

/// Splits bricks into chunks: sorted lists of nearby bricks, each of at most some thousand (32 MiB).
[[nodiscard]] std::vector<std::vector<Brick>> split_bricks(std::vector<Brick> bricks);

}  // namespace cairn
