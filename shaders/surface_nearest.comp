// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The depth of what is nearest to the colour camera, by cells of its image, as the depth camera measures it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface_colour.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceColourPush push; };
layout(binding = 0, scalar) readonly buffer View { ColourView view; };
layout(binding = 1, scalar) readonly buffer Depth { float depth[]; };
layout(binding = 2, scalar) buffer Nearest { uint nearest[]; };  // bits of depths, which are in their order

void main() {
  uint i = thread_index();
  if (i >= push.camera.width * push.camera.height || depth[i] <= 0.0) return;
  vec2 pixel;
  float z;
  if (!seen_at(view, depth[i] * ray_through(push.camera, vec2(i % push.camera.width, i / push.camera.width)), pixel, z)) return;
  uvec2 cell = uvec2(pixel + 0.5) / view.cell;
  atomicMin(nearest[cell.y * cells_of(view).x + cell.x], floatBitsToUint(z));
}
