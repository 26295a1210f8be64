// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Which loops between maps are to be believed.
#pragma once
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

/// Lays the pieces of an atlas to each other by loops between them, and adds the loops that agree with that; the others
/// are left out. Of loops between the same two pieces those count together that tell the same about how the two lie:
/// rooms that look alike give loops as well, but of many views of two maps most are true. Pieces are joined by what
/// most loops agree in, one after the other, and not where nearly as many tell something else. Returns how many were
/// added. `loops`: of keyframes of the atlas.
std::size_t join_pieces(Atlas& atlas, const std::vector<Loop>& loops);

}  // namespace cairn
