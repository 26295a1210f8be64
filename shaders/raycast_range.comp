// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth range of rays: by tile, the nearest and the farthest brick in view (Prisacariu et al. 2017, sec. 4.2).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { RaycastRangePush push; };
layout(binding = 0, scalar) readonly buffer Slots { SlotState slots[]; };
layout(binding = 1, scalar) buffer Nearest { uint nearest[]; };  // bits of positive floats sort like integers
layout(binding = 2, scalar) buffer Farthest { uint farthest[]; };

void main() {
  uint slot = thread_index();
  if (slot >= push.slots) return;
  SlotState state = slots[slot];
  if (state.used == 0u) return;
  vec3 center = inverse_transform(push.submap_from_camera, (vec3(state.brick) + 0.5) * push.brick_size);
  float radius = 0.8661 * push.brick_size;
  float near = max(center.z - radius, push.min_depth), far = min(center.z + radius, push.max_depth);
  if (far <= near) return;

  TileRange tiles = tiles_of_box(push.camera, center.xy - radius, center.xy + radius, near, far);
  if (!tiles.is_in_view) return;
  uvec2 first = tiles.first, last = tiles.last;
  uint columns = tiles_along(push.camera.width);
  for (uint y = first.y; y <= last.y; ++y) {
    for (uint x = first.x; x <= last.x; ++x) {
      uint tile = y * columns + x;
      atomicMin(nearest[tile], floatBitsToUint(near));
      atomicMax(farthest[tile], floatBitsToUint(far));
    }
  }
}
