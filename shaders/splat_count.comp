// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Number of tiles in reach by depth rank, the rank of each splat, and the number of visible splats, which precede all others.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatListPush push; };
layout(binding = 0, scalar) readonly buffer Keys { uint keys[]; };
layout(binding = 1, scalar) readonly buffer Order { uint order[]; };
layout(binding = 2, scalar) readonly buffer Tiles { uvec2 tiles[]; };
layout(binding = 3, scalar) writeonly buffer Offsets { uint offsets[]; };
layout(binding = 4, scalar) buffer Visible { uint visible; };
layout(binding = 5, scalar) readonly buffer Projected { ProjectedSplat projected[]; };
layout(binding = 6, scalar) writeonly buffer Ranks { uint ranks[]; };  // by splat

void main() {
  uint rank = thread_index();
  if (rank >= push.count) return;
  bool is_visible = keys[rank] != kNoSplatKey;
  uint i = order[rank], entries = 0u;
  if (is_visible) {
    uvec2 rect = tiles[i];
    ProjectedSplat s = projected[i];
    float reach = reach_of(s);
    for (uint y = rect.x >> 16; y <= rect.y >> 16; ++y)
      for (uint x = rect.x & 0xffffu; x <= (rect.y & 0xffffu); ++x) entries += least_of(s, x, y) <= reach ? 1u : 0u;
  }
  offsets[rank] = entries;
  ranks[i] = is_visible ? rank : kNoSplatRank;
  bool is_last = rank + 1u == push.count || keys[rank + 1u] == kNoSplatKey;
  if (is_visible && is_last) visible = rank + 1u;
}
