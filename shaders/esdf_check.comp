// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Finds voxels of blocks whose nearest site was removed or moved, and border voxels of new blocks, and lists them to
// query their neighbors. On restart, resets all voxels to their own sites. One workgroup per block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfCheckPush push; };
layout(binding = 0, scalar) readonly buffer Blocks { uint blocks[]; };  // slot << kBlockFlags | flags
layout(binding = 1, scalar) writeonly buffer List { EsdfEntry list[]; };
PAIRS(2, nearest);
WORDS(3, surface);
WORDS(4, places);

void main() {
  if (group_index() >= push.blocks) return;
  field = local(push.field);
  uint block = blocks[group_index()], base = (block >> kBlockFlags) << 12, capacity = push.capacity;
  bool is_new = (block & kBlockIsNew) != 0u, restart = (block & kBlockRestart) != 0u;
  uvec2 bits = uvec2(0u);
  for (uint i = 0u; i < 64u; ++i) {
    uint within = i * 64u + gl_LocalInvocationID.x, address = base | within;
    uvec2 found = nearest_at(nearest, address);
    bool knows_none = restart || is_far(found);
    uint word = surface_at(surface, knows_none ? address : found.x);
    bool is_gone = !knows_none && (word & (kHasSurface | kChanged)) != kHasSurface;
    uvec3 v = (uvec3(within >> 8, within >> 4, within) + 1u) & 15u;
    bool is_border = is_new && min(v.x, min(v.y, v.z)) <= 1u;
    bool counts = restart || is_gone || is_border;
    bits |= uvec2(counts && i < 32u ? 1u << i : 0u, counts && i >= 32u ? 1u << (i - 32u) : 0u);
  }
  while ((bits.x | bits.y) != 0u) {
    int i = bits.x != 0u ? findLSB(bits.x) : 32 + findLSB(bits.y);
    bits = uvec2(bits.x & (bits.x - min(bits.x, 1u)), bits.x != 0u ? bits.y : bits.y & (bits.y - 1u));
    uint address = base | (uint(i) * 64u + gl_LocalInvocationID.x);
    uvec2 found = nearest_at(nearest, address);
    uint site = restart || is_far(found) ? address : found.x, word = surface_at(surface, site);
    bool has = (word & kHasSurface) != 0u;
    if (restart || !is_far(found)) {
      ivec3 away = voxel_of(places, address) - voxel_of(places, site);
      Pairs(field.nearest).v[address] = has ? candidate(away, site_point(word), site) : uvec2(kNoVoxel);
    }
    if (restart) Words(field.surface).v[address] = word & ~(kQueued | kChanged);
    if (!restart || has) {
      if ((atomicOr(Words(field.surface).v[address], kQueued) & kQueued) == 0u) {
        uint index = append(0u, 1u);
        if (index < capacity) list[index] = EsdfEntry(address, kNoSite);
      }
    }
  }
}
