// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One step of jump flooding (Rong & Tan 2006): the nearest of the sites known to the 27 voxels at a distance.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tests/bench/shaders/trial.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { FloodPush push; };
layout(binding = 0, scalar) readonly buffer From { uint from[]; };
layout(binding = 1, scalar) writeonly buffer To { uint to[]; };

void main() {
  int i = int(gl_GlobalInvocationID.x);
  ivec3 s = push.size;
  if (i >= s.x * s.y * s.z) return;
  ivec3 voxel = ivec3(i % s.x, i / s.x % s.y, i / (s.x * s.y));
  uint best = from[i];
  float min_squared = best == kNone ? 1e9 : squared(site_at(best), voxel);
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        ivec3 there = clamp(voxel + push.reach * ivec3(x, y, z), ivec3(0), s - 1);
        uint site = from[(there.z * s.y + there.y) * s.x + there.x];
        float d = site == kNone ? 1e9 : squared(site_at(site), voxel);
        best = d < min_squared ? site : best;
        min_squared = min(min_squared, d);
      }
  to[i] = best;
}
