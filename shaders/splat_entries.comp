// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// List of (tile, splat) by depth: each splat's slots are consecutive, in the order of the splats' depth.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatListPush push; };
layout(binding = 0, scalar) readonly buffer Order { uint order[]; };
layout(binding = 1, scalar) readonly buffer Tiles { uvec2 tiles[]; };
layout(binding = 2, scalar) readonly buffer Offsets { uint offsets[]; };
layout(binding = 3, scalar) writeonly buffer Keys { uint keys[]; };
layout(binding = 4, scalar) writeonly buffer Slots { uint slots[]; };
layout(binding = 5, scalar) writeonly buffer Owners { uint owners[]; };
layout(binding = 6, scalar) readonly buffer Projected { ProjectedSplat projected[]; };

void main() {
  uint rank = thread_index();
  if (rank >= push.count) return;
  uint i = order[rank], slot = offsets[rank];
  uvec2 rect = tiles[i];
  ProjectedSplat s = projected[i];
  float reach = reach_of(s);
  for (uint y = rect.x >> 16; y <= rect.y >> 16; ++y)
    for (uint x = rect.x & 0xffffu; x <= (rect.y & 0xffffu); ++x) {
      if (!(least_of(s, x, y) <= reach)) continue;
      keys[slot] = y * push.columns + x;
      slots[slot] = slot;
      owners[slot] = i;
      ++slot;
    }
}
