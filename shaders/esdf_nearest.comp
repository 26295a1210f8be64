// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Last step of the separable transform: each voxel of a block selects the nearest of the sites that esdf_lines found
// for its cell of the box and the adjacent cells. One workgroup per block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfBoxPush push; };
layout(binding = 0, scalar) readonly buffer Blocks { uint blocks[]; };  // slots
layout(binding = 1, scalar) writeonly buffer List { EsdfEntry list[]; };
WORDS(2, cells);
WORDS(3, surface);
WORDS(4, places);

uvec2 candidate_of(ivec3 voxel, uint site) {
  return candidate(voxel - voxel_of(places, site), site_point(surface_at(surface, site)), site);
}

void main() {
  if (group_index() >= push.blocks) return;
  field = local(push.field);
  uint base = blocks[group_index()] << 12;
  ivec3 size = ivec3(push.size.x, push.size.y, push.size.z), low = ivec3(push.low.x, push.low.y, push.low.z);
  ivec3 high = ivec3(push.high.x, push.high.y, push.high.z), origin = ivec3(push.first.x, push.first.y, push.first.z);
  ivec3 corner = voxel_of(places, base);
  uint capacity = push.capacity;
  uvec2 news = uvec2(0u);
  for (uint i = 0u; i < 64u; ++i) {
    uint within = i * 64u + gl_LocalInvocationID.x;
    ivec3 voxel = corner + ivec3((within >> 8) & 15u, (within >> 4) & 15u, within & 15u), cell = voxel - origin;
    bool is_asked = all(greaterThanEqual(voxel, low)) && all(lessThan(voxel, high));
    uint own = fetch(cells, int(cell_index(clamp(cell, ivec3(0), size - 1), size)));
    uint others = 0u;
    for (int k = 0; k < 27; ++k) {
      uint site = fetch(cells, int(cell_index(clamp(cell + step_of(k), ivec3(0), size - 1), size)));
      others |= site != own && site != kNoVoxel ? 1u << k : 0u;
    }
    uvec2 best = own != kNoVoxel ? candidate_of(voxel, own) : uvec2(kNoVoxel);
    for (; others != 0u; others &= others - 1u) {
      ivec3 beside = clamp(cell + step_of(findLSB(others)), ivec3(0), size - 1);
      uvec2 theirs = candidate_of(voxel, fetch(cells, int(cell_index(beside, size))));
      best = is_nearer(theirs, best) ? theirs : best;
    }
    if (best.y >= floatBitsToUint(field.max_squared)) best = uvec2(kNoVoxel);
    if (is_asked) {
      Pairs(field.nearest).v[base | within] = best;
      Words(field.surface).v[base | within] &= ~(kQueued | kChanged);
    }
    bool is_new = is_asked && best.x != own && best.x != kNoVoxel;
    news |= uvec2(is_new && i < 32u ? 1u << i : 0u, is_new && i >= 32u ? 1u << (i - 32u) : 0u);
  }
  while ((news.x | news.y) != 0u) {
    int i = news.x != 0u ? findLSB(news.x) : 32 + findLSB(news.y);
    news = uvec2(news.x & (news.x - min(news.x, 1u)), news.x != 0u ? news.y : news.y & (news.y - 1u));
    uint voxel = base | (uint(i) * 64u + gl_LocalInvocationID.x), index = append(0u, 1u);
    if (index < capacity) list[index] = EsdfEntry(voxel, Pairs(field.nearest).v[voxel].x);
  }
}
