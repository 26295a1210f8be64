// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Halves a depth image: the mean of those of four pixels that lie on one surface.
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
  coarse[i] = mean_depth(z, at_one_place(z));
}
