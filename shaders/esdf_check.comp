// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Looks through blocks for voxels whose nearest site has gone or moved, and for the border of new blocks. These have to
// ask their neighbours. Or starts again: voxels know their own sites alone. One workgroup a block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfCheckPush push; };
layout(binding = 0, scalar) readonly buffer Blocks { uint blocks[]; };  // slot << kBlockFlags | flags
layout(binding = 1, scalar) writeonly buffer List { EsdfEntry list[]; };


void main() {
  if (group_index() >= push.blocks) return;
  uint block = blocks[group_index()], base = (block >> kBlockFlags) << 12;
  Nearest nearest = Nearest(push.field.nearest);
  Words surface = Words(push.field.surface);
  bool is_new = (block & kBlockIsNew) != 0u, restart = (block & kBlockRestart) != 0u;
  uvec2 bits = uvec2(0u);
  for (uint i = 0u; i < 64u; ++i) {
    uint local = i * 64u + gl_LocalInvocationID.x, address = base | local;
    uint64_t found = nearest.v[address];
    bool is_far = restart || found == kFar;
    uint word = surface.v[is_far ? address : site_of(found)];
    bool is_gone = !is_far && (word & (kHasSurface | kChanged)) != kHasSurface;
    uvec3 v = (uvec3(local >> 8, local >> 4, local) + 1u) & 15u;
    bool is_border = is_new && min(v.x, min(v.y, v.z)) <= 1u;
    bool counts = restart || is_gone || is_border;
    bits |= uvec2(counts && i < 32u ? 1u << i : 0u, counts && i >= 32u ? 1u << (i - 32u) : 0u);
  }
  while ((bits.x | bits.y) != 0u) {
    int i = bits.x != 0u ? findLSB(bits.x) : 32 + findLSB(bits.y);
    bits = uvec2(bits.x & (bits.x - min(bits.x, 1u)), bits.x != 0u ? bits.y : bits.y & (bits.y - 1u));
    uint address = base | (uint(i) * 64u + gl_LocalInvocationID.x);
    uint64_t found = nearest.v[address];
    uint site = restart || found == kFar ? address : site_of(found), word = surface.v[site];
    bool has = (word & kHasSurface) != 0u;
    if (restart || found != kFar) {
      ivec3 away = voxel_of(push.field, address) - voxel_of(push.field, site);
      nearest.v[address] = has ? candidate(away, site_point(word), site) : kFar;
    }
    if (restart) surface.v[address] = word & ~(kQueued | kChanged);
    if (!restart || has) {
      if ((atomicOr(surface.v[address], kQueued) & kQueued) == 0u) {
        uint index = append(push.field, 0u, 1u);
        if (index < push.capacity) list[index] = EsdfEntry(address, kNoSite);
      }
    }
  }
}
