// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Random access to voxels: as texels, which a CPU device gathers for all lanes at once, or by address if the pool
// exceeds the texel limit of the device. cairn::VoxelKernel selects the variant.
#ifndef CAIRN_POOL_H
#define CAIRN_POOL_H
#include "shaders/fetch.h"
#include "shaders/volume.h"
layout(constant_id = 4) const float kPoolInTexels = 0.0;
#define POOL(place) PAIRS(place, pool)

#define voxel_in(address, i) (kPoolInTexels > 0.0 ? fetch(pool, int(i)) : Voxels(address).v[i])
#endif
