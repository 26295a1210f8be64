// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Marching cubes (Lorensen & Cline 1987) over bricks. Each voxel owns the three edges to its upper neighbors; the index
// of an edge is axis * 512 + voxel. A cell is named by its lowest corner; corner c is at (c & 1, c >> 1 & 1, c >> 2 &
// 1).
#ifndef CAIRN_POLYGONIZE_H
#define CAIRN_POLYGONIZE_H
#include "shaders/volume.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kEdgeWords = 48;  // 3 * 512 bits
const uint kTableRow = 16;   // size of a row of the case table: triangle count, then three edges per triangle, at most
                             // five triangles

struct PolygonizePush {
  VolumeView volume;
  uint first;        // index of the first brick of this dispatch
  uint count;        // number of bricks of this dispatch
  float min_weight;  // minimum weight of a voxel that defines a surface
  // Device addresses, because these buffers may exceed the range of a binding. Both by column of 8 voxels, 64 per
  // brick.
  uvec2 cells;       // cases, a byte per voxel
  uvec2 triangles;   // number of triangles in the column's cells; later the index of its first triangle
};

struct MeshVertex {
  vec3 position;  // meters, submap frame
  vec3 normal;
  uint color;
  float weight;   // observations at 1 m
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Cells { uvec2 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Triangles { uint v[]; };
layout(push_constant, scalar) uniform Push { PolygonizePush push; };
layout(binding = 0, scalar) readonly buffer PageTable { uint page_table[]; };
layout(binding = 1, scalar) readonly buffer Bricks { ivec3 bricks[]; };

uvec2 fetch_voxel(ivec3 voxel) {
  ivec3 brick = voxel >> 3;
  uint slot = in_window(push.volume, brick) ? slot_of_entry(page_table[table_index(push.volume, brick)]) : kNoSlot;
  return slot != kNoSlot ? Voxels(push.volume.voxels).v[voxel_index(slot, voxel)] : uvec2(0);
}
// Case of a cell: bit c is set if corner c is inside; kNoCase if a corner's weight is too low.
const uint kNoCase = 256u;
uint cell_case(ivec3 voxel, uint words_min) {
  uint inside = 0u;
  uint min_units = 0xffffu;
  for (uint c = 0u; c < 8u; ++c) {
    uint word = fetch_voxel(voxel + ivec3(c & 1u, (c >> 1) & 1u, c >> 2)).x;
    min_units = min(min_units, word >> 16);
    inside |= ((word >> 15) & 1u) << c;  // sign of the distance
  }
  return min_units < words_min ? kNoCase : inside;
}
#endif
#endif
