// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Raise wavefront of the dynamic brushfire (Lau et al. 2013) in one step: voxels without a nearest site adopt the
// nearest of their neighbors' sites; neighbors in the list are ignored.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfWavePush push; };
PAIRS(0, list);
PAIRS(1, nearest);
WORDS(2, surface);
WORDS(3, places);
WORDS(4, table);

void take_over(uint address) {
  ivec3 voxel = voxel_of(places, address);
  uvec2 best = nearest_at(nearest, address);
  for (int i = 0; i < 6; ++i) {
    uint neighbor = address_of(table, voxel + face_of(i)), asked = neighbor != kNoVoxel ? neighbor : address;
    bool is_final = neighbor != kNoVoxel && (surface_at(surface, asked) & kQueued) == 0u;
    uvec2 theirs = nearest_at(nearest, asked);
    uint site = is_far(theirs) ? address : theirs.x;
    uvec2 mine = candidate(voxel - voxel_of(places, site), site_point(surface_at(surface, site)), site);
    bool is_taken = is_final && !is_far(theirs) && uintBitsToFloat(mine.y) <= field.max_squared && is_nearer(mine, best);
    best = is_taken ? mine : best;
  }
  Pairs(field.nearest).v[address] = best;
}

void main() {
  field = local(push.field);
  uint count = min(push.capacity, Counts(field.counts).v[push.step].count);
  for (uint i = gl_GlobalInvocationID.x; i < count; i += 64u * gl_NumWorkGroups.x) take_over(entry_at(list, push.list, i).x);
}
