// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Brings colour to depth: each depth pixel asks the colour image for what it sees. What something nearer hides from the
// colour camera gets no colour (0). One thread four pixels of a row: what they wait for memory overlaps.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface_colour.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceColourPush push; };
FLOATS(0, depth);
FLOATS(1, nearest);
WORDS(2, raw_colour);
layout(binding = 3, scalar) writeonly buffer Colour { uint colour[]; };

const float kUnknownDepth = 2.0;  // metres, where depth is missing: nothing there is fused, but no edge should appear
const float kHidden = 0.03;       // metres, beside the noise, that something nearer is nearer by

// Whole levels: unpackUnorm4x8 would divide each by 255.
vec3 colour_at(ivec2 p) {
  uint rgba = fetch(raw_colour, p.y * int(view().camera.width) + p.x);
  return vec3(ivec3(rgba & 0xffu, (rgba >> 8) & 0xffu, (rgba >> 16) & 0xffu));
}

// The four cells around it are asked.
bool is_hidden(vec2 pixel, float z) {
  ivec2 count = cells(), cell = ivec2(floor((pixel + 0.5) / float(view().cell) - 0.5));
  ivec2 first = clamp(cell, ivec2(0), count - 1), last = clamp(cell + 1, ivec2(0), count - 1);
  float nearer = min(min(fetch(nearest, first.y * count.x + first.x), fetch(nearest, first.y * count.x + last.x)),
                     min(fetch(nearest, last.y * count.x + first.x), fetch(nearest, last.y * count.x + last.x)));
  return nearer < z - (kHidden + 4.0 * depth_noise(z));
}

vec3 colour_between(vec2 pixel) {
  ivec2 corner = clamp(ivec2(pixel), ivec2(0), ivec2(view().camera.width, view().camera.height) - 2);
  vec2 f = pixel - vec2(corner);
  return mix(mix(colour_at(corner), colour_at(corner + ivec2(1, 0)), f.x),
             mix(colour_at(corner + ivec2(0, 1)), colour_at(corner + 1), f.x), f.y);
}

vec3 mean_colour(vec2 pixel) {
  int side = int(view().mean);
  ivec2 first = ivec2(pixel + 0.5 - 0.5 * float(side - 1)), last = ivec2(view().camera.width, view().camera.height) - 1;
  vec3 sum = vec3(0.0);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) sum += colour_at(clamp(first + ivec2(u, v), ivec2(0), last));
  return sum / float(side * side);
}

void main() {
  int width = int(push.width);
  ivec2 at = thread_place();
  if (at.x >= width || at.y >= int(push.height)) return;
  float known = fetch(depth, at.y * width + at.x), z = known > 0.0 ? known : kUnknownDepth;
  vec2 pixel;
  bool is_seen = seen_at(at, z, pixel) && !(known > 0.0 && is_hidden(pixel, z));
  ivec3 rgb = ivec3((view().mean <= 1u ? colour_between(pixel) : mean_colour(pixel)) + 0.5);
  colour[at.y * width + at.x] = is_seen ? uint(rgb.r | (rgb.g << 8) | (rgb.b << 16)) | 0xff000000u : 0u;
}
