// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Signed distances in meters from the nearest sites; NaN if unobserved. One workgroup per block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfDistancePush push; };
layout(binding = 0, scalar) readonly buffer Blocks { uint blocks[]; };  // slots
layout(binding = 1, scalar) writeonly buffer Distances { uint distances[]; };

PAIRS(2, nearest);
WORDS(3, surface);
WORDS(4, places);

const float kPlane = 0.75;  // voxels; within this radius around a site, its plane represents the surface

void main() {
  if (group_index() >= push.blocks) return;
  field = local(push.field);
  uint base = blocks[group_index()] << 12;
  float voxel_size = push.voxel_size, max_distance = push.max_distance;
  ivec3 block = voxel_of(places, base);
  for (uint i = 0u; i < 64u; ++i) {
    uint within = i * 64u + gl_LocalInvocationID.x;
    uvec2 found = nearest_at(nearest, base | within);
    uint state = surface_at(surface, base | within) >> kStateShift;
    uint site = is_far(found) ? base : found.x, word = surface_at(surface, site);
    ivec3 voxel = block + ivec3((within >> 8) & 15u, (within >> 4) & 15u, within & 15u);
    vec3 n = site_normal(word), q = vec3(voxel - voxel_of(places, site)) - site_height(word) * n;
    float height = dot(q, n), squared = dot(q, q);
    float d = squared - height * height <= kPlane * kPlane ? abs(height) : sqrt(squared);
    float meters = is_far(found) ? max_distance : min(d * voxel_size, max_distance);
    uint bits = floatBitsToUint(state == kInside ? -meters : meters);
    distances[(group_index() << 12) | within] = state == kUnknown ? 0x7fc00000u : bits;
  }
}
