// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Finds the edges of a brick that cross the surface, and counts the triangles of its cells. One thread per column.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/polygonize.h"
layout(local_size_x = 64) in;
layout(binding = 2, scalar) readonly buffer Table { uint table[]; };
layout(binding = 3, scalar) buffer Masks { uint masks[]; };        // kEdgeWords per brick, zeroed

void main() {
  if (group_index() >= push.count) return;
  uint brick = push.first + group_index();
  uint column = gl_LocalInvocationID.x;
  ivec3 base = bricks[brick] * 8 + ivec3(column >> 3, column & 7u, 0);
  uint min_units = min_weight_units(push.min_weight);
  uvec2 codes = uvec2(0);
  uint bits_x = 0u, bits_y = 0u, bits_z = 0u, count = 0u;
  for (uint k = 0u; k < 8u; ++k) {
    ivec3 v = base + ivec3(0, 0, k);
    uint code = cell_case(v, min_units);
    uint here = code == kNoCase ? 0u : code;
    codes |= uvec2(k < 4u ? here << (8u * k) : 0u, k < 4u ? 0u : here << (8u * k - 32u));
    count += table[here * kTableRow];
    uint w = fetch_voxel(v).x, wx = fetch_voxel(v + ivec3(1, 0, 0)).x;
    uint wy = fetch_voxel(v + ivec3(0, 1, 0)).x, wz = fetch_voxel(v + ivec3(0, 0, 1)).x;
    bool known = (w >> 16) >= min_units;
    bits_x |= known && (wx >> 16) >= min_units && ((w ^ wx) & 0x8000u) != 0u ? 1u << k : 0u;
    bits_y |= known && (wy >> 16) >= min_units && ((w ^ wy) & 0x8000u) != 0u ? 1u << k : 0u;
    bits_z |= known && (wz >> 16) >= min_units && ((w ^ wz) & 0x8000u) != 0u ? 1u << k : 0u;
  }
  uint word = brick * kEdgeWords + (column >> 2), shift = (column & 3u) * 8u;
  if (bits_x != 0u) atomicOr(masks[word], bits_x << shift);
  if (bits_y != 0u) atomicOr(masks[word + 16u], bits_y << shift);
  if (bits_z != 0u) atomicOr(masks[word + 32u], bits_z << shift);
  Cells(push.cells).v[brick * 64u + column] = codes;
  Triangles(push.triangles).v[brick * 64u + column] = count;
}
