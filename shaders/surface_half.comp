// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Halves a depth image: the mean of those of four pixels that belong to the nearest surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceHalfPush push; };
layout(binding = 0, scalar) readonly buffer Fine { float fine[]; };
layout(binding = 1, scalar) writeonly buffer Coarse { float coarse[]; };

void main() {
  uint i = thread_index();
  if (i >= push.width * push.height) return;
  uint at = 2u * (i / push.width) * push.fine_width + 2u * (i % push.width);
  vec4 z = vec4(fine[at], fine[at + 1u], fine[at + push.fine_width], fine[at + push.fine_width + 1u]);
  vec4 far = mix(z, vec4(1e9), equal(z, vec4(0.0)));
  float nearest = min(min(far.x, far.y), min(far.z, far.w));
  float limit = nearest + 6.0 * depth_noise(nearest);
  vec4 same = mix(vec4(0.0), vec4(1.0), lessThanEqual(far, vec4(limit)));
  coarse[i] = nearest < 1e8 ? dot(z, same) / dot(same, vec4(1.0)) : 0.0;
}
