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

vec3 colour_at(ivec2 p) { return unpackUnorm4x8(fetch(raw_colour, p.y * int(push.camera.width) + p.x)).rgb; }

// The four cells around it are asked.
bool is_hidden(vec2 pixel, float z) {
  ivec2 cells = cells_of(push), cell = ivec2(floor((pixel + 0.5) / float(push.cell) - 0.5));
  ivec2 first = clamp(cell, ivec2(0), cells - 1), last = clamp(cell + 1, ivec2(0), cells - 1);
  float nearer = min(min(fetch(nearest, first.y * cells.x + first.x), fetch(nearest, first.y * cells.x + last.x)),
                     min(fetch(nearest, last.y * cells.x + first.x), fetch(nearest, last.y * cells.x + last.x)));
  return nearer < z - (kHidden + 4.0 * depth_noise(z));
}

vec3 colour_between(vec2 pixel) {
  ivec2 corner = clamp(ivec2(pixel), ivec2(0), ivec2(push.camera.width, push.camera.height) - 2);
  vec2 f = pixel - vec2(corner);
  return mix(mix(colour_at(corner), colour_at(corner + ivec2(1, 0)), f.x),
             mix(colour_at(corner + ivec2(0, 1)), colour_at(corner + 1), f.x), f.y);
}

vec3 mean_colour(vec2 pixel) {
  int side = int(push.mean);
  ivec2 first = ivec2(pixel + 0.5 - 0.5 * float(side - 1)), last = ivec2(push.camera.width, push.camera.height) - 1;
  vec3 sum = vec3(0.0);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) sum += colour_at(clamp(first + ivec2(u, v), ivec2(0), last));
  return sum / float(side * side);
}

void main() {
  const int kRun = 4;
  int width = int(push.width);
  ivec2 at = thread_place() * ivec2(kRun, 1);
  if (at.x >= width || at.y >= int(push.height)) return;
  at.x = min(at.x, width - kRun);  // the last four of a row lie over those before them where four do not divide it
  float known[kRun], z[kRun];
  vec2 pixel[kRun];
  bool is_seen[kRun];
  for (int k = 0; k < kRun; ++k) known[k] = fetch(depth, at.y * width + at.x + k);
  for (int k = 0; k < kRun; ++k) {
    z[k] = known[k] > 0.0 ? known[k] : kUnknownDepth;
    is_seen[k] = seen_at(push, uvec2(at + ivec2(k, 0)), z[k], pixel[k]);
    pixel[k] = is_seen[k] ? pixel[k] : vec2(0.0);
  }
  for (int k = 0; k < kRun; ++k) is_seen[k] = is_seen[k] && !(is_hidden(pixel[k], z[k]) && known[k] > 0.0);
  for (int k = 0; k < kRun; ++k) {
    vec3 rgb = push.mean <= 1u ? colour_between(pixel[k]) : mean_colour(pixel[k]);
    colour[at.y * width + at.x + k] = is_seen[k] ? packUnorm4x8(vec4(rgb, 1.0)) : 0u;
  }
}
