// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>

#include "volume/volume.hpp"

namespace cairn {

/// Bricks filled from a distance function, meters: exact voxels without a camera, each observed once.
template <class Distance>
BrickTree distance_bricks(const FuseOptions& options, const Eigen::Vector3f& low, const Eigen::Vector3f& high,
                          const Distance& distance) {
  BrickTree tree;
  const float size = 8 * options.voxel_size, voxel = options.voxel_size, truncation = options.truncation;
  const auto first = (low / size).array().floor().cast<int>(), last = (high / size).array().floor().cast<int>();
  for (int x = first.x(); x <= last.x(); ++x)
    for (int y = first.y(); y <= last.y(); ++y)
      for (int z = first.z(); z <= last.z(); ++z) {
        BrickVoxels voxels{};
        for (std::uint32_t i = 0; i < 512; ++i) {
          const Eigen::Vector3f p = voxel * Eigen::Vector3f(static_cast<float>(8 * x + static_cast<int>(i >> 6)),
                                                            static_cast<float>(8 * y + static_cast<int>(i >> 3 & 7)),
                                                            static_cast<float>(8 * z + static_cast<int>(i & 7)));
          const float d = std::clamp(distance(p) / truncation, -1.0f, 1.0f);
          voxels[i] = shader::pack_voxel(d, 1, 0x01806040);
        }
        tree.put({x, y, z}, voxels);
      }
  return tree;
}

/// Copy of a tree's voxels and free space.
inline BrickList brick_list_of(const BrickTree& tree) {
  BrickList list{.bricks = tree.bricks(), .voxels = {}, .free = tree.copy_free()};
  list.voxels.resize(list.bricks.size());
  for (std::size_t i = 0; i < list.bricks.size(); ++i)
    std::copy_n(tree.find(list.bricks[i]), list.voxels[i].size(), list.voxels[i].begin());
  return list;
}

/// Fills a volume in the same way as distance_bricks().
template <class Distance>
void fill(Volume& volume, const Eigen::Vector3f& low, const Eigen::Vector3f& high, const Distance& distance) {
  volume.adopt(distance_bricks(volume.options(), low, high, distance));
}

}  // namespace cairn
