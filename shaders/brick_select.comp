// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Lists the bricks in view and not behind the depth image. Lists none while a brick needed by the frame waits for the
// host.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { BrickSelectPush push; };
layout(binding = 0, scalar) buffer Slots { SlotState slots[]; };
layout(binding = 1, scalar) readonly buffer Farthest { float farthest[]; };
layout(binding = 2, scalar) buffer Counts { FusionCounts counts; };
layout(binding = 3, scalar) writeonly buffer Selection { Selected selected[]; };

void main() {
  uint slot = thread_index();
  if (slot >= push.slots || counts.waiting != 0u) return;
  SlotState state = slots[slot];
  if (state.used == 0u) return;
  vec3 center = inverse_transform(push.submap_from_camera, (vec3(state.brick) + 0.5) * push.brick_size);
  // Half extent of the rotated brick along the camera axes, up to the outermost voxel centers.
  float half_brick = 0.4375 * push.brick_size;
  vec3 extent = half_brick * (abs(inverse_rotate(push.submap_from_camera, vec3(1, 0, 0))) +
                              abs(inverse_rotate(push.submap_from_camera, vec3(0, 1, 0))) +
                              abs(inverse_rotate(push.submap_from_camera, vec3(0, 0, 1))));
  center -= (inverse_rotate(push.submap_from_camera, vec3(1.0)) * (0.0625 * push.brick_size));
  float near = max(center.z - extent.z, 0.5 * push.min_depth), far = center.z + extent.z;
  if (far < push.min_depth) return;

  TileRange tiles = tiles_of_box(push.camera, center.xy - extent.xy, center.xy + extent.xy, near, far);
  if (!tiles.is_in_view) return;
  uvec2 first = tiles.first, last = tiles.last;
  uint columns = tiles_along(push.camera.width);
  float seen = 0.0;
  // Single loop: lanes with small bricks need not wait for the widest row.
  uint across = last.x - first.x + 1u, count = across * (last.y - first.y + 1u);
  uint tile = first.y * columns + first.x, x = 0u;
  for (uint n = 0u; n < count; ++n) {
    seen = max(seen, farthest[tile]);
    bool turn = ++x == across;
    tile += turn ? columns + 1u - across : 1u;
    if (turn) x = 0u;
  }
  if (seen == 0.0 || seen + push.truncation < near) return;

  slots[slot].last_seen = push.fused_count;
  uint place = atomicAdd(counts.selected, 1u);
  if (place >= push.capacity) return;
  selected[place] = Selected(slot, seen);
  if (place < kMaxGroups) atomicAdd(counts.fused.x, 1u);
  if (place != 0u && place % kMaxGroups == 0u) atomicAdd(counts.fused.y, 1u);
}
