// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/voxels.hpp"

#include <tbb/parallel_for.h>

#include "shaders/voxel.h"

namespace cairn {

Voxels voxels_of(const BrickTree& tree, const GridInfo& info) {
  constexpr std::size_t kBrick = 512;  // voxels
  Voxels voxels{.voxel_size = info.voxel_size,
                .truncation = info.truncation,
                .world_from_voxels = info.upright.world_from_tracked.cast<float>(),
                .blocks = tree.bricks(),
                .distances = {},
                .weights = {},
                .colors = {}};
  voxels.distances.resize(kBrick * voxels.blocks.size());
  voxels.weights.resize(voxels.distances.size());
  voxels.colors.resize(voxels.distances.size());
  tbb::parallel_for(std::size_t{0}, voxels.blocks.size(), [&](std::size_t block) {
    const std::uint64_t* packed = tree.find(voxels.blocks[block]);
    for (std::size_t i = 0, at = kBrick * block; i < kBrick; ++i, ++at) {
      const std::uint64_t voxel = packed[i];
      voxels.weights[at] = shader::voxel_weight(voxel);
      if (voxels.weights[at] > 0) voxels.distances[at] = info.truncation * shader::voxel_distance(voxel);
      for (std::size_t byte = 0; byte < 4; ++byte)
        voxels.colors[at][byte] = static_cast<std::uint8_t>(voxel >> (32 + 8 * byte));
    }
  });
  return voxels;
}

}  // namespace cairn
