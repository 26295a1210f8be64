// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "volume/grids.hpp"

namespace cairn {

/// What a map knows of the voxels of a brick.
struct KnownSpace {
  BrickBits known{};  // observed, or seen to be free
  BrickBits clear{};  // free, as is all next to them, with no surface within reach
};

/// `voxels` with those of the bricks around, `free` what else was seen to be free. `reach`: voxels, 8 at most.
[[nodiscard]] KnownSpace known_space(const BrickTree& voxels, const BrickTree& free, const Eigen::Vector3i& brick,
                                     int reach);

}  // namespace cairn
