// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The voxels as a kernel reads them where it likes: as texels, which a CPU device gathers for all its lanes at once, or, in
// a pool of more voxels than the device has texels, by their address. cairn::VoxelKernel makes the one or the other.
#ifndef CAIRN_POOL_H
#define CAIRN_POOL_H
#include "shaders/fetch.h"
#include "shaders/volume.h"
layout(constant_id = 4) const float kPoolInTexels = 0.0;
#define POOL(place) PAIRS(place, pool)

#define voxel_in(address, i) (kPoolInTexels > 0.0 ? fetch(pool, int(i)) : Voxels(address).v[i])
#endif
