// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Brings colour to depth: each depth pixel asks the colour image for what it sees. What something nearer hides from the
// colour camera gets no colour (0).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface_colour.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceColourPush push; };
layout(binding = 0, scalar) readonly buffer Depth { float depth[]; };
layout(binding = 1, scalar) readonly buffer Nearest { uint nearest[]; };
layout(binding = 2, scalar) readonly buffer RawColour { uint raw_colour[]; };
layout(binding = 3, scalar) writeonly buffer Colour { uint colour[]; };

const float kUnknownDepth = 2.0;  // metres, where depth is missing: nothing there is fused, but no edge should appear
const float kHidden = 0.03;       // metres, beside the noise, that something nearer is nearer by

vec3 colour_at(uvec2 p) { return unpackUnorm4x8(raw_colour[p.y * push.camera.width + p.x]).rgb; }

// The four cells around it are asked.
bool is_hidden(vec2 pixel, float z) {
  ivec2 cells = ivec2(cells_of(push)), cell = ivec2(floor((pixel + 0.5) / float(push.cell) - 0.5));
  ivec2 first = clamp(cell, ivec2(0), cells - 1), last = clamp(cell + 1, ivec2(0), cells - 1);
  uint nearer = min(min(nearest[first.y * cells.x + first.x], nearest[first.y * cells.x + last.x]),
                    min(nearest[last.y * cells.x + first.x], nearest[last.y * cells.x + last.x]));
  return uintBitsToFloat(nearer) < z - (kHidden + 4.0 * depth_noise(z));
}

vec3 colour_around(vec2 pixel) {
  uvec2 last = uvec2(push.camera.width, push.camera.height) - 1u;
  if (push.mean <= 1u) {
    uvec2 corner = min(uvec2(pixel), last - 1u);
    vec2 f = pixel - vec2(corner);
    return mix(mix(colour_at(corner), colour_at(corner + uvec2(1u, 0u)), f.x),
               mix(colour_at(corner + uvec2(0u, 1u)), colour_at(corner + 1u), f.x), f.y);
  }
  ivec2 first = ivec2(pixel + 0.5 - 0.5 * float(push.mean - 1u));
  vec3 sum = vec3(0.0);
  for (uint k = 0u; k < push.mean * push.mean; ++k)
    sum += colour_at(uvec2(clamp(first + ivec2(k % push.mean, k / push.mean), ivec2(0), ivec2(last))));
  return sum / float(push.mean * push.mean);
}

void main() {
  uint i = thread_index();
  if (i >= push.width * push.height) return;
  float known = depth[i], z = known > 0.0 ? known : kUnknownDepth;
  vec2 pixel;
  bool is_seen = seen_at(push, uvec2(i % push.width, i / push.width), z, pixel) && !(known > 0.0 && is_hidden(pixel, z));
  colour[i] = is_seen ? packUnorm4x8(vec4(colour_around(pixel), 1.0)) : 0u;
}
