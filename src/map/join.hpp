// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Which loops between maps are to be believed.
#pragma once
#include <vector>

#include "map/atlas.hpp"
#include "map/views_apart.hpp"

namespace cairn {

/// Lays the pieces of an atlas to each other by loops between them, and adds the loops that agree with that; the others
/// are left out. Of loops between the same two pieces those count together that tell the same about how the two lie:
/// rooms that look alike give loops as well, and may give more than true ones. So pieces are joined one after the
/// other, those first whose views have most corners in common, which are of the same place from the same side; not
/// where all that was joined with them so far would contradict what the others saw (ViewsApart), not where nearly as
/// many loops tell something else that would not, and not where the camera would have gone farther than it can while it
/// was lost. After each join the poses are optimised, each of tracking's steps as one that may have slipped. Returns
/// how many were added. `loops`: of keyframes of the atlas.
std::size_t join_pieces(Atlas& atlas, const std::vector<Loop>& loops, ViewsApart& views);

/// Whether the pose graph does not believe many of the loops between pieces of a run, that was tracked with breaks.
[[nodiscard]] bool contradict_each_other(const Atlas& atlas);

/// Lays the pieces of a run to each other anew, by all loops between them that were found on the way: each of these was
/// believed or not when little was known. As join_pieces(), but that those come first which most loops join, since they
/// are of all sizes. Loops that do not agree are dropped. Pieces that nothing joins stay apart.
void join_anew(Atlas& atlas, ViewsApart& views);

}  // namespace cairn
