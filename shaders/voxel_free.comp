// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Finds the voxels of bricks in front of the depth image by more than the truncation: a ray has passed them. All four
// pixels around must agree, so that a gross outlier does not free voxels behind a surface. A thread processes 32
// voxels, a word of bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { VoxelFreePush push; };
FLOATS(0, quad_min_depth);  // nearest depth of 2x2 pixels
layout(binding = 1, scalar) readonly buffer PartBricks { ivec3 bricks[]; };
layout(binding = 2, scalar) writeonly buffer Bits { uint bits[]; };

void main() {
  uint word = gl_GlobalInvocationID.x, brick = word >> 4;
  Rigid camera_from_submap = local(push.camera_from_submap);
  float voxel = push.voxel_size, margin = push.truncation;
  vec2 focal = vec2(push.camera.fx, push.camera.fy), center = vec2(push.camera.cx, push.camera.cy) + 0.5;
  int width = int(push.camera.width), height = int(push.camera.height), columns = (width + 1) >> 1;
  ivec3 first = bricks[min(brick, push.bricks - 1u)] * 8 + ivec3((word >> 1) & 7u, (word & 1u) * 4u, 0);
  vec3 p = transform(camera_from_submap, vec3(first) * voxel);
  vec3 step_z = camera_from_submap.z * voxel, step_y = camera_from_submap.y * voxel - 8.0 * step_z;
  uint found = 0u;
  for (uint k = 0u; k < 32u; ++k) {
    vec2 pixel = focal * p.xy * (1.0 / p.z) + center;
    bool inside = p.z > 0.0 && min(pixel.x, pixel.y) >= 0.0 && pixel.x < float(width) && pixel.y < float(height);
    float z = fetch(quad_min_depth, inside ? (int(pixel.y) >> 1) * columns + (int(pixel.x) >> 1) : 0);
    found |= inside && p.z < z - margin ? 1u << k : 0u;
    p += step_z;
    if ((k & 7u) == 7u) p += step_y;
  }
  if (brick < push.bricks) bits[word] = found;
}
