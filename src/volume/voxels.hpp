// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/mapping/voxels.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {

/// Unpacks the voxels of a tree.
[[nodiscard]] Voxels voxels_of(const BrickTree& tree, const GridInfo& info);

}  // namespace cairn
