// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Halves a depth image: the mean of the pixels of a 2x2 block on the same surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceHalfPush push; };
FLOATS(0, fine);
layout(binding = 1, scalar) writeonly buffer Coarse { float coarse[]; };

void main() {
  ivec2 p = thread_place();
  int width = int(push.width), fine_width = int(push.fine_width);
  if (p.x >= width || p.y >= int(push.height)) return;
  int at = 2 * (p.y * fine_width + p.x);
  vec4 z = vec4(fetch(fine, at), fetch(fine, at + 1), fetch(fine, at + fine_width), fetch(fine, at + fine_width + 1));
  coarse[p.y * width + p.x] = mean_depth(z, on_same_surface(z));
}
