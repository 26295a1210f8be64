// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth of the surface nearest to the color camera, by cell of its image, from every second depth pixel of every second
// row.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface_color.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceColorPush push; };
FLOATS(0, depth);
layout(binding = 1, scalar) buffer Nearest { uint nearest[]; };  // bits of positive floats sort like integers

void main() {
  ivec2 at = 2 * thread_place(), size = ivec2(push.width, push.height);
  if (at.x >= size.x || at.y >= size.y) return;
  float z = fetch(depth, at.y * size.x + at.x);
  vec2 pixel;
  if (z <= 0.0 || !seen_at(local(push.motion), vec2(at), z, pixel)) return;
  ivec2 cell = ivec2((pixel + 0.5) / float(view().cell));
  atomicMin(nearest[cell.y * cells().x + cell.x], floatBitsToUint(z));
}
