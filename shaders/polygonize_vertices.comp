// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Emits the vertices of a brick's edges in the order of their bits. One thread per mask word.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/polygonize.h"
layout(local_size_x = 64) in;
layout(binding = 2, scalar) readonly buffer Masks { uint masks[]; };
layout(binding = 3, scalar) readonly buffer Firsts { uint firsts[]; };  // index of the first vertex by mask word
layout(binding = 4, scalar) writeonly buffer Vertices { MeshVertex vertices[]; };

float distance_or(ivec3 voxel, float otherwise) {
  uint word = fetch_voxel(voxel).x;
  return (word >> 16) != 0u ? voxel_distance(word) : otherwise;
}
// Central differences, one-sided if a neighbor was never observed.
vec3 gradient(ivec3 v, float d) {
  return vec3(distance_or(v + ivec3(1, 0, 0), d) - distance_or(v - ivec3(1, 0, 0), d),
              distance_or(v + ivec3(0, 1, 0), d) - distance_or(v - ivec3(0, 1, 0), d),
              distance_or(v + ivec3(0, 0, 1), d) - distance_or(v - ivec3(0, 0, 1), d));
}

void main() {
  if (thread_index() >= push.count * kEdgeWords) return;
  uint index = push.first * kEdgeWords + thread_index();
  uint bits = masks[index];
  uint vertex = firsts[index] - firsts[push.first * kEdgeWords];
  uint word = index % kEdgeWords;
  uint axis = word >> 4;
  ivec3 step_v = ivec3(axis == 0u, axis == 1u, axis == 2u);
  ivec3 base = bricks[index / kEdgeWords] * 8;
  while (bits != 0u) {
    uint voxel = (word & 15u) * 32u + uint(findLSB(bits));
    bits &= bits - 1u;
    ivec3 a = base + ivec3(voxel >> 6, (voxel >> 3) & 7u, voxel & 7u), b = a + step_v;
    uvec2 wa = fetch_voxel(a), wb = fetch_voxel(b);
    float da = voxel_distance(wa.x), db = voxel_distance(wb.x);
    // Keeps vertices of adjacent edges distinct even if a voxel is exactly on the surface.
    float t = clamp(da / (da - db), 0.001, 0.999);
    vec3 n = mix(gradient(a, da), gradient(b, db), t);
    float ca = (wa.y >> 24) != 0u ? 1.0 - t : 0.0, cb = (wb.y >> 24) != 0u ? t : 0.0;
    vec3 color = (ca * unpackUnorm4x8(wa.y).rgb + cb * unpackUnorm4x8(wb.y).rgb) / max(ca + cb, 1e-6);
    if (ca + cb == 0.0) color = vec3(0.7);
    vertices[vertex++] = MeshVertex((vec3(a) + t * vec3(step_v)) * push.volume.voxel_size, n / max(length(n), 1e-12),
                                    packUnorm4x8(vec4(color, 1.0)),
                                    mix(voxel_weight(wa.x), voxel_weight(wb.x), t));
  }
}
