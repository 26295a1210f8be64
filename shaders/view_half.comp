// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Halves a point image: the mean of the points of a 2x2 block on the same surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceHalfPush push; };
PAIRS(0, fine);
layout(binding = 1, scalar) writeonly buffer Coarse { uvec2 coarse[]; };

void main() {
  ivec2 p = thread_place();
  int width = int(push.width), fine_width = int(push.fine_width);
  if (p.x >= width || p.y >= int(push.height)) return;
  int at = 2 * (p.y * fine_width + p.x);
  uvec2 a = fetch(fine, at), b = fetch(fine, at + 1), c = fetch(fine, at + fine_width), d = fetch(fine, at + fine_width + 1);
  vec4 z = uintBitsToFloat(uvec4(a.x, b.x, c.x, d.x));
  vec4 same = on_same_surface(z);
  vec3 n = same.x * unpack_normal(a.y) + same.y * unpack_normal(b.y) + same.z * unpack_normal(c.y) + same.w * unpack_normal(d.y);
  float depth = mean_depth(z, same);
  coarse[p.y * width + p.x] = depth > 0.0 ? uvec2(floatBitsToUint(depth), pack_normal(n / max(length(n), 1e-12))) : uvec2(0);
}
