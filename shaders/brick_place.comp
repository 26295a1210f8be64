// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Assigns slots with empty voxels to bricks, removes slots, or updates the table entries of bricks without a slot. One
// workgroup per brick.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { BrickPlacePush push; };
layout(binding = 0, scalar) readonly buffer Placements { Placement placements[]; };
layout(binding = 1, scalar) writeonly buffer PageTable { uint page_table[]; };
layout(binding = 2, scalar) writeonly buffer Slots { SlotState slots[]; };

void main() {
  if (group_index() >= push.count) return;
  Placement p = placements[group_index()];
  if (gl_LocalInvocationID.x == 0u) page_table[p.table_index] = p.entry;
  if (p.slot == kNoSlot) return;
  Voxels pool = Voxels(push.voxels);
  for (uint i = gl_LocalInvocationID.x; i < kBrickVoxels; i += 64u) pool.v[(p.slot << 9) | i] = uvec2(0);
  if (gl_LocalInvocationID.x == 0u)
    slots[p.slot] = SlotState(p.brick, slot_of_entry(p.entry) == p.slot ? 1u : 0u, push.fused_count);
}
