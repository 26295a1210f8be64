// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Lists bricks completely or partly in front of the depth image, from the farthest and the nearest measurement of each
// image tile that a brick may cover. Skips bricks already known to be completely free, and bricks into which this frame
// was integrated.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { BrickFreePush push; };
layout(binding = 0, scalar) readonly buffer Farthest { float farthest[]; };
layout(binding = 1, scalar) readonly buffer Nearest { float nearest[]; };
layout(binding = 2, scalar) readonly buffer PageTable { uint page_table[]; };
layout(binding = 3, scalar) readonly buffer Marks { uint marks[]; };
layout(binding = 4, scalar) buffer Counts { FusionCounts counts; };
layout(binding = 5, scalar) writeonly buffer FreeBricks { ivec3 free_bricks[]; };
layout(binding = 6, scalar) writeonly buffer PartBricks { ivec3 part_bricks[]; };

const float kNearest = 0.02;  // meters; nearer space is tested per voxel
const uint kMaxTiles = 64u;  // bricks that cover more tiles are tested per voxel, too

void main() {
  Pinhole camera = local(push.camera);
  camera.cx += 0.5;  // a pixel starts half a pixel before its center
  camera.cy += 0.5;
  Rigid camera_from_submap = local(push.camera_from_submap);
  VolumeView volume = local(push.volume);
  // A layer has at most 2^20 bricks: a float represents their indices exactly.
  int index = int(gl_GlobalInvocationID.x), z = int(gl_WorkGroupID.y);
  int x_size = int(push.size & 1023u), y_size = int((push.size >> 10) & 1023u);
  int y = int((float(index) + 0.5) / float(x_size));
  if (y >= y_size) return;
  ivec3 brick = push.first + ivec3(index - y * x_size, y, z);
  if (!in_window(volume, brick) || counts.waiting != 0u) return;

  // Bounds of the voxel centers.
  float voxel = volume.voxel_size, margin = volume.truncation;
  vec3 center = transform(camera_from_submap, (vec3(brick * 8) + 3.5) * voxel);
  vec3 extent = 3.5 * voxel * (abs(camera_from_submap.x) + abs(camera_from_submap.y) + abs(camera_from_submap.z));
  float far = center.z + extent.z, near = max(center.z - extent.z, kNearest);
  uint at = table_index(volume, brick), entry = page_table[at];
  bool is_fused = entry != 0u && entry != kOnHost && far >= push.min_depth;
  bool is_known = is_fused || (marks[at >> 5] & (1u << (at & 31u))) != 0u;
  TileRange tiles = tiles_of_box(camera, center.xy - extent.xy, center.xy + extent.xy, near, max(far, near));
  bool may_be_free = !is_known && tiles.is_in_view && far > 0.0;

  uvec2 across = tiles.last - tiles.first + 1u;
  uint columns = tiles_along(push.camera.width), tile = tiles.first.y * columns + tiles.first.x, x = 0u;
  uint count = across.x * across.y;
  bool is_wide = count > kMaxTiles;
  float max_depth = is_wide ? 1e9 : 0.0, min_depth = is_wide ? 0.0 : 1e9;
  for (uint n = may_be_free && !is_wide ? count : 0u; n > 0u; --n) {
    max_depth = max(max_depth, farthest[tile]);
    min_depth = min(min_depth, nearest[tile]);
    bool turn = ++x == across.x;
    tile += turn ? columns + 1u - across.x : 1u;
    if (turn) x = 0u;
    if (max_depth > near + margin && min_depth <= far + margin) n = 1u;  // partly free
  }
  if (!may_be_free || max_depth <= near + margin) return;
  if (min_depth > far + margin && near > kNearest && tiles.is_fully_in_view) {
    uint place = atomicAdd(counts.free, 1u);
    if (place < free_bricks.length()) free_bricks[place] = brick;  // else found by a later pass
    return;
  }
  uint place = atomicAdd(counts.free_in_part, 1u);
  if (place >= part_bricks.length()) return;
  part_bricks[place] = brick;
  if (place % kPartsAGroup == 0u) atomicAdd(counts.carved.x, 1u);
}
