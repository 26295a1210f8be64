// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Number of tiles by depth rank, and the number of visible splats, which precede all others.
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

void main() {
  uint rank = thread_index();
  if (rank >= push.count) return;
  bool is_visible = keys[rank] != kNoSplatKey;
  uvec2 rect = tiles[order[rank]];
  uvec2 size = uvec2((rect.y & 0xffffu) - (rect.x & 0xffffu), (rect.y >> 16) - (rect.x >> 16)) + 1u;
  offsets[rank] = is_visible ? size.x * size.y : 0u;
  bool is_last = rank + 1u == push.count || keys[rank + 1u] == kNoSplatKey;
  if (is_visible && is_last) visible = rank + 1u;
}
