// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What programs find that look for the surface in a map's distances without asking which of them are known.
#pragma once
#include <Eigen/Core>
#include <span>
#include <utility>
#include <vector>

#include "volume/grids.hpp"

namespace cairn {

/// Which voxels of a brick count as behind the surface, unknown ones among them: these have the sign of the nearest
/// known one, of several as near in front. `behind`: of the known ones.
[[nodiscard]] BrickBits with_unknown(const BrickBits& known, const BrickBits& behind);

/// Bricks beside the first `own` of these that are none of them, and of which most neighbours are behind the surface:
/// where they count as behind it, too, there is no step at their sides. `bricks` as with_unknown gives them, behind the
/// own ones all that are two steps from these.
[[nodiscard]] std::vector<Eigen::Vector3i> behind_beside(std::span<const std::pair<Eigen::Vector3i, BrickBits>> bricks,
                                                         std::size_t own);
/// The bricks there, in steps from one.
[[nodiscard]] std::vector<Eigen::Vector3i> two_steps();

/// Of each of the first `own` bricks the voxels that are the lowest corner of a cube of eight known ones. Elsewhere the
/// distances have no surface that anybody saw. In the order of `known`, where all those at upper_corners of the own
/// ones stand behind these.
[[nodiscard]] std::vector<BrickBits> whole_cells(std::span<const std::pair<Eigen::Vector3i, BrickBits>> known,
                                                 std::size_t own);
/// In steps from one.
[[nodiscard]] std::vector<Eigen::Vector3i> upper_corners();

}  // namespace cairn
