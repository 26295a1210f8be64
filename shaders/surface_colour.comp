// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Brings colour to depth: each depth pixel asks the colour image for what it sees. What something nearer hides from the
// colour camera gets no colour (0).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface_colour.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceColourPush push; };
layout(binding = 0, scalar) readonly buffer View { ColourView view; };
layout(binding = 1, scalar) readonly buffer Depth { float depth[]; };
layout(binding = 2, scalar) readonly buffer Nearest { uint nearest[]; };
layout(binding = 3, scalar) readonly buffer RawColour { uint raw_colour[]; };
layout(binding = 4, scalar) writeonly buffer Colour { uint colour[]; };

const float kUnknownDepth = 2.0;  // metres, where depth is missing: nothing there is fused, but no edge should appear
const float kHidden = 0.03;       // metres, beside the noise, that something nearer is nearer by

vec3 colour_at(uvec2 p) { return unpackUnorm4x8(raw_colour[p.y * view.camera.width + p.x]).rgb; }

bool is_hidden(vec2 pixel, float z) {
  ivec2 cells = ivec2(cells_of(view)), cell = ivec2(pixel + 0.5) / int(view.cell);
  float first = 1e9;
  for (int k = 0; k < 9; ++k) {
    ivec2 at = clamp(cell + ivec2(k % 3, k / 3) - 1, ivec2(0), cells - 1);
    first = min(first, uintBitsToFloat(nearest[at.y * cells.x + at.x]));
  }
  return first < z - (kHidden + 4.0 * depth_noise(z));
}

void main() {
  uint i = thread_index();
  if (i >= push.camera.width * push.camera.height) return;
  float known = depth[i], z;
  vec2 pixel;
  vec3 point = (known > 0.0 ? known : kUnknownDepth) * ray_through(push.camera, vec2(i % push.camera.width, i / push.camera.width));
  colour[i] = 0u;
  if (!seen_at(view, point, pixel, z) || (known > 0.0 && is_hidden(pixel, z))) return;
  uvec2 last = uvec2(view.camera.width, view.camera.height) - 1u;
  vec3 sum = vec3(0.0);
  if (view.mean <= 1u) {
    uvec2 corner = min(uvec2(pixel), last - 1u);
    vec2 f = pixel - vec2(corner);
    sum = mix(mix(colour_at(corner), colour_at(corner + uvec2(1u, 0u)), f.x),
              mix(colour_at(corner + uvec2(0u, 1u)), colour_at(corner + 1u), f.x), f.y);
  } else {
    ivec2 first = ivec2(pixel + 0.5 - 0.5 * float(view.mean - 1u));
    for (uint k = 0u; k < view.mean * view.mean; ++k)
      sum += colour_at(uvec2(clamp(first + ivec2(k % view.mean, k / view.mean), ivec2(0), ivec2(last))));
    sum /= float(view.mean * view.mean);
  }
  colour[i] = packUnorm4x8(vec4(sum, 1.0));
}
