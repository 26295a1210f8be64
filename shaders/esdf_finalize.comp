// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Finishes a list: stores the current sites of its voxels, so that the next step does not depend on the thread order.
// Clears the queue flags of the first list.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfWavePush push; };
layout(binding = 0, scalar) buffer List { EsdfEntry list[]; };
layout(binding = 1, scalar) buffer Dirty { uint dirty[]; };
PAIRS(2, nearest);

void finalize(uint i, uint step) {
  EsdfEntry entry = list[i];
  uint site = nearest_at(nearest, entry.voxel).x;
  if (step == 0u) {
    Words(field.surface).v[entry.voxel] &= ~(kQueued | kChanged);
    list[i].site = site;
  }
  // If several sites were offered to a voxel in one step, only the nearest propagates.
  if (step != 0u && site != entry.site) list[i].site = kNoSite;
  if (dirty[entry.voxel >> 12] == 0u) dirty[entry.voxel >> 12] = 1u;  // avoids contention between cores that write to
                                                                      // the same word
}

void main() {
  field = local(push.field);
  uint step = push.step, count = min(push.capacity, Counts(field.counts).v[step].count);
  for (uint i = gl_GlobalInvocationID.x; i < count; i += 64u * gl_NumWorkGroups.x) finalize(i, step);
}
