// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// First and end entry of each tile, from the sorted tiles of all entries, and the splat of each entry.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatListPush push; };
layout(binding = 0, scalar) readonly buffer Keys { uint keys[]; };
layout(binding = 1, scalar) readonly buffer Slots { uint slots[]; };
layout(binding = 2, scalar) readonly buffer Owners { uint owners[]; };
layout(binding = 3, scalar) writeonly buffer Ranges { uint ranges[]; };
layout(binding = 4, scalar) writeonly buffer Splats { uint splats[]; };

void main() {
  uint i = thread_index();
  if (i >= push.count) return;
  uint tile = keys[i];
  splats[i] = owners[slots[i]];
  if (i == 0u || keys[i - 1u] != tile) ranges[2u * tile] = i;
  if (i + 1u == push.count || keys[i + 1u] != tile) ranges[2u * tile + 1u] = i + 1u;
}
