// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Registers color to depth: each depth pixel samples the color image at its projection. Points occluded in the color
// camera get no color (0).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface_color.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceColorPush push; };
FLOATS(0, depth);
FLOATS(1, nearest);
WORDS(2, raw_color);
layout(binding = 3, scalar) writeonly buffer Fusion { uvec2 fusion[]; };  // (depth bits, color)

vec3 color_at(ivec2 p) { return levels_of(fetch(raw_color, p.y * int(view().camera.width) + p.x)); }

vec3 color_between(vec2 pixel) {
  ivec2 corner = clamp(ivec2(pixel), ivec2(0), ivec2(view().camera.width, view().camera.height) - 2);
  vec2 f = pixel - vec2(corner);
  return mix(mix(color_at(corner), color_at(corner + ivec2(1, 0)), f.x),
             mix(color_at(corner + ivec2(0, 1)), color_at(corner + 1), f.x), f.y);
}

vec3 mean_color(vec2 pixel) {
  int side = int(view().mean);
  ivec2 first = ivec2(pixel + 0.5 - 0.5 * float(side - 1)), last = ivec2(view().camera.width, view().camera.height) - 1;
  vec3 sum = vec3(0.0);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) sum += color_at(clamp(first + ivec2(u, v), ivec2(0), last));
  return sum / float(side * side);
}

void main() {
  int width = int(push.width);
  ivec2 at = thread_place();
  if (at.x >= width || at.y >= int(push.height)) return;
  float measured = fetch(depth, at.y * width + at.x), z = measured > 0.0 ? measured : kUnknownDepth;
  vec2 pixel;
  bool is_seen = seen_at(local(push.motion), vec2(at), z, pixel) && !(measured > 0.0 && is_hidden(nearest, pixel, z));
  ivec3 rgb = ivec3((view().mean <= 1u ? color_between(pixel) : mean_color(pixel)) + 0.5);
  fusion[at.y * width + at.x].y = is_seen ? uint(rgb.r | (rgb.g << 8) | (rgb.b << 16)) | 0xff000000u : 0u;
}
