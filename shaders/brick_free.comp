// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Lists bricks without voxels that lie wholly in front of what the depth image sees: all eight corners and the middle
// are nearer than the measurement behind them. A bit for each brick of the window tells which are known already.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { BrickFreePush push; };
PAIRS(0, fusion);  // (depth bits, colour)
layout(binding = 1, scalar) readonly buffer PageTable { uint page_table[]; };
layout(binding = 2, scalar) buffer Marks { uint marks[]; };
layout(binding = 3, scalar) buffer Counts { FusionCounts counts; };
layout(binding = 4, scalar) writeonly buffer FreeBricks { ivec3 free_bricks[]; };

Pinhole camera;

bool in_front(vec3 p) {
  vec2 pixel = project(camera, p) + 0.5;
  int width = int(camera.width), height = int(camera.height);
  bool inside = p.z > 0.0 && min(pixel.x, pixel.y) >= 0.0 && pixel.x < float(width) && pixel.y < float(height);
  return inside && p.z < uintBitsToFloat(fetch(fusion, inside ? int(pixel.y) * width + int(pixel.x) : 0).x);
}

void main() {
  camera = local(push.camera);
  Rigid camera_from_submap = local(push.camera_from_submap);
  VolumeView volume = local(push.volume);
  // A layer has at most 2^20 bricks: a float holds their numbers.
  int index = int(gl_GlobalInvocationID.x), z = int(gl_WorkGroupID.y);
  int x_size = int(push.size & 1023u), y_size = int((push.size >> 10) & 1023u);
  int y = int((float(index) + 0.5) / float(x_size));
  if (y >= y_size) return;
  ivec3 brick = push.first + ivec3(index - y * x_size, y, z);
  if (!in_window(volume, brick) || counts.waiting != 0u) return;
  float size = 8.0 * volume.voxel_size;
  vec3 middle = transform(camera_from_submap, (vec3(brick) + 0.5) * size);
  uint at = table_index(volume, brick), bit = 1u << (at & 31u);
  bool is_free = in_front(middle) && page_table[at] == 0u && (marks[at >> 5] & bit) == 0u;
  vec3 half_x = 0.5 * size * camera_from_submap.x, half_y = 0.5 * size * camera_from_submap.y,
       half_z = 0.5 * size * camera_from_submap.z;
  for (int corner = 0; corner < (is_free ? 8 : 0); ++corner)
    is_free = in_front(middle + ((corner & 1) != 0 ? half_x : -half_x) + ((corner & 2) != 0 ? half_y : -half_y) +
                       ((corner & 4) != 0 ? half_z : -half_z));
  if (!is_free) return;
  uint place = atomicAdd(counts.looked_through, 1u);
  if (place >= push.capacity) return;  // the next pass lists it
  free_bricks[place] = brick;
  atomicOr(marks[at >> 5], bit);
}
