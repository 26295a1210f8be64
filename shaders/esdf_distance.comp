// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Signed distances in metres from what the voxels know; NaN where nothing was observed. One workgroup a block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfDistancePush push; };
layout(binding = 0, scalar) readonly buffer Blocks { uint blocks[]; };  // slots
layout(binding = 1, scalar) writeonly buffer Distances { uint distances[]; };

const float kPlane = 0.75;  // voxels: so far around a site its plane is the surface

void main() {
  if (group_index() >= push.blocks) return;
  uint base = blocks[group_index()] << 12;
  ivec3 block = voxel_of(push.field, base);
  Words surface = Words(push.field.surface);
  for (uint i = 0u; i < 64u; ++i) {
    uint local = i * 64u + gl_LocalInvocationID.x;
    uint64_t found = Nearest(push.field.nearest).v[base | local];
    uint state = surface.v[base | local] >> kStateShift;
    bool is_far = found == kFar;
    uint site = is_far ? base : site_of(found);
    uint word = surface.v[site];
    ivec3 voxel = block + ivec3((local >> 8) & 15u, (local >> 4) & 15u, local & 15u);
    vec3 n = site_normal(word), q = vec3(voxel - voxel_of(push.field, site)) - site_height(word) * n;
    float height = dot(q, n), squared = dot(q, q);
    float d = squared - height * height <= kPlane * kPlane ? abs(height) : sqrt(squared);
    float metres = is_far ? push.max_distance : min(d * push.voxel_size, push.max_distance);
    uint bits = floatBitsToUint(state == kInside ? -metres : metres);
    distances[(group_index() << 12) | local] = state == kUnknown ? 0x7fc00000u : bits;
  }
}
