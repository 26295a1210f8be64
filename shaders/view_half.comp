// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Halves a point image: the mean of those of four points that lie on one surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceHalfPush push; };
layout(binding = 0, scalar) readonly buffer Fine { uvec2 fine[]; };
layout(binding = 1, scalar) writeonly buffer Coarse { uvec2 coarse[]; };

void main() {
  uint i = thread_index();
  if (i >= push.width * push.height) return;
  uint at = 2u * (i / push.width) * push.fine_width + 2u * (i % push.width);
  uvec2 a = fine[at], b = fine[at + 1u], c = fine[at + push.fine_width], d = fine[at + push.fine_width + 1u];
  vec4 z = uintBitsToFloat(uvec4(a.x, b.x, c.x, d.x));
  vec4 same = at_one_place(z);
  vec3 n = same.x * unpack_normal(a.y) + same.y * unpack_normal(b.y) + same.z * unpack_normal(c.y) + same.w * unpack_normal(d.y);
  float depth = mean_depth(z, same);
  coarse[i] = depth > 0.0 ? uvec2(floatBitsToUint(depth), pack_normal(n / max(length(n), 1e-12))) : uvec2(0);
}
