// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The depth of what is nearest to the colour camera, by cells of its image, as every second depth pixel of every second
// row tells it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface_colour.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceColourPush push; };
layout(binding = 0, scalar) readonly buffer Depth { float depth[]; };
layout(binding = 1, scalar) buffer Nearest { uint nearest[]; };  // bits of depths, which are in their order

void main() {
  uint i = thread_index(), columns = push.width / 2u;
  uvec2 at = 2u * uvec2(i % columns, i / columns);
  if (at.y >= push.height) return;
  float z = depth[at.y * push.width + at.x];
  vec2 pixel;
  if (z <= 0.0 || !seen_at(push, at, z, pixel)) return;
  uvec2 cell = uvec2(pixel + 0.5) / push.cell;
  atomicMin(nearest[cell.y * cells_of(push).x + cell.x], floatBitsToUint(z));
}
