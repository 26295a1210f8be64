// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Surface seen from a pose: (depth, normal) by pixel in the camera frame (Newcombe et al. 2011, sec. 3.4). Rays march
// through nearest voxels until the sign changes; interpolation then refines the crossing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/pool.h"
layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { RaycastPush push; };
WORDS(0, page_table);
FLOATS(1, nearest);
FLOATS(2, farthest);
layout(binding = 3, scalar) writeonly buffer Points { uvec2 points[]; };
POOL(4);

VolumeView volume;

uint find_slot(ivec3 voxel) {
  ivec3 brick = voxel >> 3;
  return in_window(volume, brick) ? slot_of_entry(fetch(page_table, int(table_index(volume, brick)))) : kNoSlot;
}

// Distance in truncations, and 1 if observed, else 0.
vec2 fetch(ivec3 voxel) {
  uint slot = find_slot(voxel);
  uint word = slot != kNoSlot ? voxel_in(volume.voxels, voxel_index(slot, voxel)).x : 0u;
  return vec2(voxel_distance(word), (word >> 16) != 0u ? 1.0 : 0.0);
}

// Trilinear distance (w, in truncations) and its gradient (xyz, per voxel); w = 2 if a corner is unobserved.
vec4 sample_field(vec3 v) {
  ivec3 i = ivec3(floor(v));
  vec3 f = v - vec3(i);
  vec2 c000 = fetch(i), c100 = fetch(i + ivec3(1, 0, 0));
  vec2 c010 = fetch(i + ivec3(0, 1, 0)), c110 = fetch(i + ivec3(1, 1, 0));
  vec2 c001 = fetch(i + ivec3(0, 0, 1)), c101 = fetch(i + ivec3(1, 0, 1));
  vec2 c011 = fetch(i + ivec3(0, 1, 1)), c111 = fetch(i + ivec3(1, 1, 1));
  float seen = c000.y * c100.y * c010.y * c110.y * c001.y * c101.y * c011.y * c111.y;
  float x00 = mix(c000.x, c100.x, f.x), x10 = mix(c010.x, c110.x, f.x);
  float x01 = mix(c001.x, c101.x, f.x), x11 = mix(c011.x, c111.x, f.x);
  float y0 = mix(x00, x10, f.y), y1 = mix(x01, x11, f.y);
  vec3 gradient = vec3(mix(mix(c100.x - c000.x, c110.x - c010.x, f.y), mix(c101.x - c001.x, c111.x - c011.x, f.y), f.z),
                       mix(x10 - x00, x11 - x01, f.z), y1 - y0);
  return vec4(gradient, seen > 0.0 ? mix(y0, y1, f.z) : 2.0);
}

const int kSteps = 64;  // longer rays graze the border of the observed space and find no surface to align with

void main() {
  uvec2 pixel = gl_GlobalInvocationID.xy;
  volume = local(push.volume);
  Pinhole camera = local(push.camera);
  Rigid submap_from_camera = local(push.submap_from_camera);
  if (pixel.x >= camera.width || pixel.y >= camera.height) return;
  int tile = int((pixel.y / kTile) * tiles_along(camera.width) + pixel.x / kTile);
  float t = fetch(nearest, tile), end = fetch(farthest, tile);

  // In voxels; t is the depth, since the ray has z = 1 in the camera frame.
  float inverse_voxel = 1.0 / volume.voxel_size;
  vec3 ray = rotate(submap_from_camera, ray_through(camera, vec2(pixel))) * inverse_voxel;
  vec3 origin = submap_from_camera.t * inverse_voxel;
  float per_voxel = 1.0 / length(ray);
  float truncation = volume.truncation * inverse_voxel;

  float before = t, before_d = 0.0;  // last sample in front of the surface; 0: none
  float hit = 0.0;
  for (int steps = 0; steps < kSteps && t < end; ++steps) {
    vec3 v = origin + ray * t;
    ivec3 voxel = ivec3(floor(v + 0.5));
    uint slot = find_slot(voxel);
    if (slot == kNoSlot) {
      vec3 low = vec3((voxel >> 3) << 3) - 0.5;
      vec3 exit = (mix(low, low + 8.0, greaterThan(ray, vec3(0.0))) - origin) / ray;
      t = max(t, min(min(exit.x, exit.y), exit.z)) + 0.1 * per_voxel;
      before_d = 0.0;
      continue;
    }
    uint word = voxel_in(volume.voxels, voxel_index(slot, voxel)).x;
    // A voxel exactly on the surface counts as in front: 0 marks unobserved voxels.
    float distance = voxel_distance(word);
    float d = (word >> 16) != 0u ? (distance == 0.0 ? 1e-4 : distance) * truncation : 0.0;
    if (d < 0.0) {
      // Back face, or seen through a hole: no surface to align with.
      if (before_d > 0.0) hit = mix(before, t, before_d / (before_d - d));
      break;
    }
    before = t;
    before_d = d;
    // The band in front of a surface is one truncation thick: steps of half of it cannot skip a surface.
    t += (d > 0.0 ? max(0.8 * d, 0.5) : 0.5 * truncation) * per_voxel;
  }

  // Two Newton steps along the ray, with distance in truncations and t in depth. A single step suffices for tracking,
  // but not for place recognition.
  vec4 field = vec4(0.0);
  for (int i = 0; i < 2; ++i) {
    field = sample_field(origin + ray * hit);
    float slope = dot(field.xyz, ray);
    float change = slope < 0.0 && field.w < 1.5 ? clamp(-field.w / slope, -2.0 * per_voxel, 2.0 * per_voxel) : 0.0;
    hit += change;
  }
  bool found = hit > 0.0 && field.w < 0.5 && dot(field.xyz, field.xyz) > 0.0;
  vec3 n = inverse_rotate(submap_from_camera, field.xyz);
  points[pixel.y * camera.width + pixel.x] =
      found ? uvec2(floatBitsToUint(hit), pack_normal(n / max(length(n), 1e-12))) : uvec2(0);
}
