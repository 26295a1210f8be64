// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Lists the bricks without a slot in the truncation bands of a grid of measurements, and assigns vacant slots to them.
// The assignment depends on the thread order; results do not depend on it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { BrickMarkPush push; };
PAIRS(0, fusion);
layout(binding = 1, scalar) buffer PageTable { uint page_table[]; };
layout(binding = 2, scalar) buffer Counts { FusionCounts counts; };
layout(binding = 3, scalar) writeonly buffer Missing { Placement missing[]; };
layout(binding = 4, scalar) readonly buffer Vacant { uint vacant[]; };

void main() {
  uint columns = push.camera.width / push.stride, rows = push.camera.height / push.stride;
  uint i = thread_index();
  if (i >= columns * rows) return;
  uvec2 pixel = push.stride * uvec2(i % columns, i / columns) + uvec2(push.phase % push.stride, (push.phase / push.stride) % push.stride);
  float z = uintBitsToFloat(fetch(fusion, int(pixel.y * push.camera.width + pixel.x)).x);
  if (z <= 0.0) return;
  VolumeView volume = local(push.volume);
  vec3 ray = rotate(push.submap_from_camera, ray_through(push.camera, vec2(pixel))), from = push.submap_from_camera.t;
  float band = volume.truncation, inverse_voxel = 1.0 / volume.voxel_size;
  // Steps of at most half a brick, with a sample on the surface: a ray misses a brick only if it cuts its corner.
  int steps = int(ceil(band * 0.25 * inverse_voxel - 0.01));
  float step_z = band / float(steps);
  for (int k = -steps; k <= steps; ++k) {
    vec3 p = from + ray * (z + float(k) * step_z);
    ivec3 brick = ivec3(floor(p * inverse_voxel + 0.5)) >> 3;
    if (!in_window(volume, brick)) continue;
    uint at = table_index(volume, brick);
    uint entry = page_table[at];
    if (entry != 0u && entry != kOnHost) continue;
    if (atomicCompSwap(page_table[at], entry, kPending) != entry) continue;
    uint place = atomicAdd(counts.missing, 1u);
    bool has_slot = entry == 0u && place < push.vacant;
    if (!has_slot) atomicAdd(counts.waiting, 1u);
    if (place >= push.capacity) {
      page_table[at] = entry;  // left to the next pass
      continue;
    }
    atomicAdd(counts.placed.x, 1u);
    uint slot = has_slot ? vacant[place] : kNoSlot;
    missing[place] = Placement(brick, slot, at, has_slot ? slot + 1u : kPending);
  }
}
