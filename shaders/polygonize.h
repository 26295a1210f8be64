// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Marching cubes (Lorensen & Cline 1987) over bricks. Each voxel owns the three edges to its + neighbours; edge number
// axis * 512 + voxel. A cell is named by its lowest corner; corner c lies at (c & 1, c >> 1 & 1, c >> 2 & 1).
#ifndef CAIRN_POLYGONIZE_H
#define CAIRN_POLYGONIZE_H
#include "shaders/volume.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kEdgeWords = 48;  // 3 * 512 bits
const uint kTableRow = 16;   // of the case table: triangle count, then three edges a triangle, at most five triangles

struct PolygonizePush {
  VolumeView volume;
  uint first;        // list position of the first brick of this dispatch
  uint count;        // bricks of this dispatch
  float min_weight;  // of a voxel that may make surface
  // Device addresses, since these outgrow the range of a binding first. Both go by column of 8 voxels, 64 a brick.
  uvec2 cells;       // cases, a byte a voxel
  uvec2 triangles;   // triangles of the column's cells; later the number of its first one
};

struct MeshVertex {
  vec3 position;  // metres, submap frame
  vec3 normal;
  uint colour;
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
// Of one cell's corner words: which corners lie inside (bit c), or kNoCase where one is not known well enough.
const uint kNoCase = 256u;
uint cell_case(ivec3 voxel, uint words_min) {
  uint inside = 0u;
  uint least = 0xffffu;
  for (uint c = 0u; c < 8u; ++c) {
    uint word = fetch_voxel(voxel + ivec3(c & 1u, (c >> 1) & 1u, c >> 2)).x;
    least = min(least, word >> 16);
    inside |= ((word >> 15) & 1u) << c;  // the sign of the distance
  }
  return least < words_min ? kNoCase : inside;
}
#endif
#endif
