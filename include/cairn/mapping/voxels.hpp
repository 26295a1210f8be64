// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

namespace cairn {

/// Truncated signed distances of a map as plain arrays, in blocks of 8x8x8 voxels. Block (i, j, k) starts with voxel 8
/// (i, j, k); voxel (i, j, k) samples the point world_from_voxels * (voxel_size * (i, j, k)). Index of a voxel within
/// its block: x * 64 + y * 8 + z; the arrays are concatenated block by block.
struct Voxels {
  float voxel_size = 0;  ///< meters
  float truncation = 0;  ///< meters, on each side of the surface
  Eigen::Quaternionf world_from_voxels = Eigen::Quaternionf::Identity();
  std::vector<Eigen::Vector3i> blocks;              ///< sorted by x, then y, then z
  std::vector<float> distances;                     ///< meters; positive in front of a surface; 0 if the weight is 0
  std::vector<float> weights;                       ///< observations at 1 m; 0: never observed
  std::vector<std::array<std::uint8_t, 4>> colors;  ///< R, G, B (sRGB) and color weight; weight 0: no color observed
};

}  // namespace cairn
