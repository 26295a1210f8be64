// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/voxels.hpp"
#include "volume/grids.hpp"

namespace cairn {

/// Unpacks the voxels of a tree.
[[nodiscard]] Voxels voxels_of(const BrickTree& tree, const GridInfo& info);

}  // namespace cairn
