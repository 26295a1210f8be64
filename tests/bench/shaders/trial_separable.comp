// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One axis of the exact transform: the lower envelope of parabolas along each line (Felzenszwalb & Huttenlocher 2012,
// with sites as in Cao et al. 2010). One thread per line; neighboring threads read neighboring words.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "tests/bench/shaders/trial.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SeparablePush push; };
layout(binding = 0, scalar) readonly buffer From { uint from[]; };
layout(binding = 1, scalar) writeonly buffer To { uint to[]; };
layout(binding = 2, scalar) buffer Stack { uvec2 stack[]; };  // (site, first voxel nearest to the site)

void main() {
  int line = int(gl_GlobalInvocationID.x);
  if (line >= int(push.lines)) return;
  ivec3 s = push.size;
  ivec3 first = push.axis == 2u ? ivec3(line % s.x, line / s.x, 0)
                                : push.axis == 1u ? ivec3(line % s.x, 0, line / s.x) : ivec3(0, line % s.y, line / s.y);
  ivec3 along = push.axis == 2u ? ivec3(0, 0, 1) : push.axis == 1u ? ivec3(0, 1, 0) : ivec3(1, 0, 0);
  int stride = push.axis == 2u ? s.x * s.y : push.axis == 1u ? s.x : 1, count = push.axis == 2u ? s.z : push.axis == 1u ? s.y : s.x;
  int base = (first.z * s.y + first.y) * s.x + first.x, lines = int(push.lines), depth = 0;
  for (int i = 0; i < count; ++i) {
    uint site = from[base + i * stride];
    if (site != kNone) {
      ivec3 p = site_at(site);
      // Squared distance of the site in the plane across the line; along the line the site is at `at`.
      int at = push.axis == 2u ? p.z : push.axis == 1u ? p.y : p.x;
      ivec3 in_plane = p + (i - at) * along;
      float f = squared(in_plane, first + i * along);
      float start = 0.0;
      bool searching = true;
      while (searching) {
        if (depth == 0) {
          searching = false;
        } else {
          uvec2 top = stack[(depth - 1) * lines + line];
          ivec3 q = site_at(top.x);
          int qt = push.axis == 2u ? q.z : push.axis == 1u ? q.y : q.x;
          float g = squared(q + (i - qt) * along, first + i * along);
          start = at == qt ? (f < g ? 0.0 : 1e9) : (f + float(at * at) - g - float(qt * qt)) / float(2 * (at - qt));
          if (start <= uintBitsToFloat(top.y)) {
            --depth;
            start = 0.0;
          } else {
            searching = false;
          }
        }
      }
      if (start < float(count)) {
        stack[depth * lines + line] = uvec2(site, floatBitsToUint(depth == 0 ? -1.0 : start));
        ++depth;
      }
    }
  }
  int top = 0;
  uvec2 now = depth > 0 ? stack[line] : uvec2(kNone, 0u), next = depth > 1 ? stack[lines + line] : uvec2(kNone, 0u);
  for (int i = 0; i < count; ++i) {
    while (top + 1 < depth && uintBitsToFloat(next.y) <= float(i)) {
      ++top;
      now = next;
      next = stack[min(top + 1, depth - 1) * lines + line];
    }
    to[base + i * stride] = now.x;
  }
}
