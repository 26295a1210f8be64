// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Fuses a depth image into bricks (Curless & Levoy 1996, eq. 3 and 4). One workgroup a brick, one thread a column of
// eight voxels along z. What is in front of the measurement by more than the truncation becomes free space: surfaces
// that have gone are carved away.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TsdfIntegratePush push; };
layout(binding = 0, scalar) readonly buffer Selected { uint selected[]; };
layout(binding = 1, scalar) readonly buffer Slots { SlotState slots[]; };
layout(binding = 2, scalar) readonly buffer Fusion { uvec2 fusion[]; };  // (depth bits, colour)

const float kMaxColourWeight = 32.0;

void main() {
  uint slot = selected[gl_WorkGroupID.x];
  uint column = gl_LocalInvocationID.x;
  ivec3 voxel = slots[slot].brick * 8 + ivec3(column >> 3, column & 7u, 0);
  vec3 p = transform(push.camera_from_submap, vec3(voxel) * push.voxel_size);
  vec3 step_p = push.camera_from_submap.z * push.voxel_size;
  uint at = (slot << 9) | (column << 3);
  Voxels pool = Voxels(push.voxels);
  float inverse_truncation = 1.0 / push.truncation;

  for (uint k = 0u; k < 8u; ++k, p += step_p) {
    vec2 pixel = project(push.camera, p) + 0.5;
    bool inside = p.z > 0.0 && pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < float(push.camera.width) &&
                  pixel.y < float(push.camera.height);
    uint i = inside ? uint(pixel.y) * push.camera.width + uint(pixel.x) : 0u;
    uvec2 measured = inside ? fusion[i] : uvec2(0);
    float z = uintBitsToFloat(measured.x);
    float sdf = (z - p.z) * inverse_truncation;
    if (z > 0.0 && sdf > -1.0) {
      uvec2 old = pool.v[at + k];
      // A structured-light measurement is worth less with the square of its distance (Khoshelham & Elberink 2012).
      float weight = 1.0 / max(1.0, z * z);
      float old_weight = voxel_weight(old.x);
      float sum = old_weight + weight;
      float d = (voxel_distance(old.x) * old_weight + min(sdf, 1.0) * weight) / sum;
      uint word = (uint(int(round(clamp(d, -1.0, 1.0) * 32767.0))) & 0xffffu) |
                  (uint(round(min(sum, push.max_weight) * kWeightUnit)) << 16);
      uint rgb = old.y;
      if (push.has_colour != 0u && sdf < 1.0) {
        float n = float(rgb >> 24);
        vec3 mean = (unpackUnorm4x8(rgb).rgb * n + unpackUnorm4x8(measured.y).rgb) / (n + 1.0);
        rgb = packUnorm4x8(vec4(mean, min(n + 1.0, kMaxColourWeight) / 255.0));
      }
      pool.v[at + k] = uvec2(word, rgb);
    }
  }
}
