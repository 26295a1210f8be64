// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "volume/vdb/brick_tree.hpp"

namespace cairn {

/// Observed voxels of a brick.
struct ObservedSpace {
  BrickBits observed{};  // observed, or carved as free space
  BrickBits clear{};     // free with 26 free neighbors and no surface within `reach`
};

/// `voxels` also contains the neighboring bricks; `free` holds additional free space. `reach`: voxels, at most 8.
[[nodiscard]] ObservedSpace observed_space(const BrickTree& voxels, const BrickTree& free, const Eigen::Vector3i& brick,
                                           int reach);

}  // namespace cairn
