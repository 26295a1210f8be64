// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A map's voxels, part by part, for what looks at all of it and never at once.
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "cairn/upright.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

struct MapParts {
  std::vector<Brick> bricks;                         // of the whole map, sorted
  Volume& volume;                                    // of the whole map, or of what `load` has brought
  std::function<void(std::span<const Brick>)> load;  // brings bricks in place of those before; none: all are there
  Polygonizer& polygonizer;
  const BrickTree& free;  // what was seen to be free
  Upright upright;        // how all of it is turned to be in the world that is written

  [[nodiscard]] float voxel_size() const { return volume.options().voxel_size; }
  /// Brings those of the map's bricks that are in a list, and those around them.
  void bring_around(const std::vector<Brick>& part) const;
};

/// Bricks in lists of at most some thousand (32 MiB) that lie together, each sorted.
[[nodiscard]] std::vector<std::vector<Brick>> in_parts(std::vector<Brick> bricks);

}  // namespace cairn
