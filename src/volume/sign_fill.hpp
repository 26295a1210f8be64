// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Signs of unknown voxels, for programs that extract a zero crossing from a map's distances without checking the active
// mask.
#pragma once
#include <Eigen/Core>
#include <span>
#include <utility>
#include <vector>

#include "volume/vdb/brick_tree.hpp"

namespace cairn {

/// Voxels of a brick behind the surface. Unknown voxels get the sign of the nearest known voxel; positive if several
/// are equally near. `behind`: the known voxels behind the surface.
[[nodiscard]] BrickBits fill_unknown_signs(const BrickBits& known, const BrickBits& behind);

/// Missing neighbors of the first `own` bricks that are mostly surrounded by voxels behind the surface: marking these
/// neighbors as behind, too, avoids a step at their sides. `bricks`: as returned by fill_unknown_signs; the own bricks
/// are followed by all bricks within two_steps.
[[nodiscard]] std::vector<Eigen::Vector3i> inside_neighbors(
    std::span<const std::pair<Eigen::Vector3i, BrickBits>> bricks, std::size_t own);
/// Offsets of the bricks for inside_neighbors.
[[nodiscard]] std::vector<Eigen::Vector3i> two_steps();

/// For each of the first `own` bricks, the voxels at the lowest corner of a cube of eight known voxels; any other zero
/// crossing of the distances was not observed. In the order of `known`, with the own bricks first, then all bricks at
/// their upper_corners.
[[nodiscard]] std::vector<BrickBits> fully_observed_cells(std::span<const std::pair<Eigen::Vector3i, BrickBits>> known,
                                                          std::size_t own);
/// Offsets of the bricks for fully_observed_cells.
[[nodiscard]] std::vector<Eigen::Vector3i> upper_corners();

}  // namespace cairn
