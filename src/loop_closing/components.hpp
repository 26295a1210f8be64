// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Merging of map components by mutually consistent loop closures.
#pragma once
#include <vector>

#include "loop_closing/free_space_conflicts.hpp"
#include "map/atlas.hpp"

namespace cairn {

/// Aligns the components of an atlas by loop closures between them and adds the loop closures that agree with the
/// result; the rest is dropped. Loop closures between the same two components are clustered by their relative pose,
/// since similar rooms also cause loop closures, possibly more than the true ones. Components are merged one by one, in
/// order of the feature inliers, which are many for views of the same place from the same side. A merge is rejected if
/// it contradicts the free space seen so far (FreeSpaceConflicts), if nearly as many loop closures support a different,
/// consistent alignment, or if the camera would have moved farther than possible while lost. After each merge the poses
/// are optimized, with heavy-tailed odometry steps. Returns the number of added loop closures. `loops`: between
/// keyframes of the atlas.
std::size_t merge_components(Atlas& atlas, const std::vector<Loop>& loops, FreeSpaceConflicts& views);

/// True if the pose graph rejects many of the loop closures between the components of a run with tracking breaks.
[[nodiscard]] bool has_inconsistent_loops(const Atlas& atlas);

/// Merges the components of a run from scratch, with all loop closures found between them, since each was accepted or
/// rejected with the little evidence of its time. As merge_components(), but pairs with the most loop closures come
/// first, since the components differ in size. Inconsistent loop closures are dropped. Components without an accepted
/// merge stay separate.
void remerge_components(Atlas& atlas, FreeSpaceConflicts& views);

}  // namespace cairn
