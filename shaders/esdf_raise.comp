// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The raise wave of Lau et al. 2013 in one step: voxels that lost their nearest site take over the nearest of those that
// their neighbours outside of the list know.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfWavePush push; };
layout(binding = 0, scalar) readonly buffer List { EsdfEntry list[]; };

ivec3 face_of(int i) { int s = 1 - 2 * (i & 1), a = i >> 1; return ivec3(a == 0 ? s : 0, a == 1 ? s : 0, a == 2 ? s : 0); }

void take_over(uint address) {
  ivec3 voxel = voxel_of(push.field, address);
  Nearest nearest = Nearest(push.field.nearest);
  Words surface = Words(push.field.surface);
  uint64_t best = nearest.v[address];
  uint bits = 0u;
  for (int i = 0; i < 6; ++i) {
    uint neighbour = address_of(push.field, voxel + face_of(i));
    bool is_settled = neighbour != kNoVoxel && (surface.v[neighbour != kNoVoxel ? neighbour : address] & kQueued) == 0u;
    bits |= is_settled ? 1u << i : 0u;
  }
  for (; bits != 0u; bits &= bits - 1u) {
    uint neighbour = address_of(push.field, voxel + face_of(findLSB(bits)));
    uint64_t theirs = nearest.v[neighbour];
    uint site = theirs == kFar ? address : site_of(theirs);
    uint64_t mine = candidate(voxel - voxel_of(push.field, site), site_point(surface.v[site]), site);
    if (theirs != kFar && squared_of(mine) <= push.field.max_squared) best = min(best, mine);
  }
  nearest.v[address] = best;
}

void main() {
  uint count = min(push.capacity, Counts(push.field.counts).v[push.step].count);
  for (uint i = gl_GlobalInvocationID.x; i < count; i += 64u * gl_NumWorkGroups.x) take_over(list[i].voxel);
}
