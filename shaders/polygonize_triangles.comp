// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Emits the triangles of a brick's cells. One thread per column; triangles keep the order of the cells.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/polygonize.h"
layout(local_size_x = 64) in;
layout(binding = 2, scalar) readonly buffer Table { uint table[]; };
layout(binding = 3, scalar) readonly buffer Masks { uint masks[]; };
layout(binding = 4, scalar) readonly buffer Firsts { uint firsts[]; };
layout(binding = 5, scalar) readonly buffer Neighbors { uint neighbors[]; };  // 8 per brick: index of brick + corner
                                                                                // c
layout(binding = 6, scalar) writeonly buffer Indices { uint indices[]; };

// Vertex on the edge that starts at a corner of a cell and runs along an axis.
uint vertex_on(uint brick, uvec3 cell, uint edge) {
  uint corner = edge & 7u, axis = edge >> 3;
  uvec3 v = cell + uvec3(corner & 1u, (corner >> 1) & 1u, corner >> 2);
  uint owner = neighbors[brick * 8u + ((v.x >> 3) | ((v.y >> 3) << 1) | ((v.z >> 3) << 2))];
  v &= 7u;
  uint bit = (v.x << 6) | (v.y << 3) | v.z;
  uint word = owner * kEdgeWords + axis * 16u + (bit >> 5);
  return firsts[word] + bitCount(masks[word] & ((1u << (bit & 31u)) - 1u));
}

void main() {
  if (group_index() >= push.count) return;
  uint brick = push.first + group_index();
  uint column = gl_LocalInvocationID.x;
  Triangles first = Triangles(push.triangles);
  uint triangle = first.v[brick * 64u + column] - first.v[push.first * 64u];
  uvec2 codes = Cells(push.cells).v[brick * 64u + column];
  for (uint k = 0u; k < 8u; ++k) {
    uint row = ((k < 4u ? codes.x : codes.y) >> (8u * (k & 3u)) & 0xffu) * kTableRow;
    uint corners = 3u * table[row];
    for (uint i = 0u; i < corners; ++i)
      indices[triangle * 3u + i] = vertex_on(brick, uvec3(column >> 3, column & 7u, k), table[row + 1u + i]);
    triangle += corners / 3u;
  }
}
