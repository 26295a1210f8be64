// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Writes the sites of blocks into a dense box, for esdf_lines. One workgroup per block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfBoxPush push; };
layout(binding = 0, scalar) readonly buffer Blocks { uint blocks[]; };  // slots
layout(binding = 1, scalar) writeonly buffer Cells { uint cells[]; };   // site addresses; kNoVoxel: no site
WORDS(2, surface);
WORDS(3, places);

void main() {
  if (group_index() >= push.blocks) return;
  field = local(push.field);
  uint base = blocks[group_index()] << 12;
  ivec3 size = ivec3(push.size.x, push.size.y, push.size.z);
  ivec3 corner = voxel_of(places, base) - ivec3(push.first.x, push.first.y, push.first.z);
  for (uint i = 0u; i < 64u; ++i) {
    uint within = i * 64u + gl_LocalInvocationID.x;
    ivec3 cell = corner + ivec3((within >> 8) & 15u, (within >> 4) & 15u, within & 15u);
    if (is_in_box(cell, size) && (surface_at(surface, base | within) & kHasSurface) != 0u)
      cells[cell_index(cell, size)] = base | within;
  }
}
