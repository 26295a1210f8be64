// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Brightness in 0..1 of a coarser level's pixels, directly from a color camera next to the depth camera: the mean over
// all color pixels that a pixel of the level covers. -1 if any of them is over- or underexposed or occluded.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface_color.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceBrightnessPush push; };
FLOATS(0, depth);  // at this level
FLOATS(1, nearest);
WORDS(2, raw_color);
layout(binding = 3, scalar) writeonly buffer Intensity { float intensity[]; };

void main() {
  int width = int(push.width);
  ivec2 at = thread_place();
  if (at.x >= width || at.y >= int(push.height)) return;
  float measured = fetch(depth, at.y * width + at.x), z = measured > 0.0 ? measured : kUnknownDepth;
  vec2 pixel;
  bool is_seen = seen_at(local(push.motion), vec2(at) * float(kFactor) + 0.5 * float(kFactor - 1u), z, pixel) &&
                 !(measured > 0.0 && is_hidden(nearest, pixel, z));
  // A square of integer side with a subpixel start: the first and the last pixel of a row are covered partly.
  int side = int(view().mean * kFactor);
  vec2 begin = pixel - 0.5 * float(side - 1);
  ivec2 first = ivec2(floor(begin)), last = ivec2(view().camera.width, view().camera.height) - 1;
  vec2 part = begin - vec2(first);
  float sum = 0.0;
  for (int v = 0; v <= side; ++v)
    for (int u = 0; u <= side; ++u) {
      ivec2 p = clamp(first + ivec2(u, v), ivec2(0), last);
      vec3 rgb = levels_of(fetch(raw_color, p.y * int(view().camera.width) + p.x));
      is_seen = is_seen && is_exposed(rgb);
      sum += luminance(rgb) * (u == 0 ? 1.0 - part.x : u == side ? part.x : 1.0) *
             (v == 0 ? 1.0 - part.y : v == side ? part.y : 1.0);
    }
  intensity[at.y * width + at.x] = is_seen ? sum / float(side * side) : -1.0;
}
