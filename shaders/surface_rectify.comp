// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Removes lens distortion: nearest measurement for depth (an average across an edge is no surface), bilinear for colour.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface_colour.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceRectifyPush push; };
FLOATS(0, raw_depth);
WORDS(1, raw_colour);
layout(binding = 2, scalar) writeonly buffer Depth { float depth[]; };
layout(binding = 3, scalar) writeonly buffer Colour { uint colour[]; };

void main() {
  Pinhole camera = view().camera;  // its constants are the depth camera's
  int width = int(camera.width), height = int(camera.height);
  ivec2 place = thread_place();
  if (place.x >= width || place.y >= height) return;
  int i = place.y * width + place.x;
  vec2 pixel = bend_of_view(ray_through(camera, vec2(place)).xy) * vec2(camera.fx, camera.fy) + vec2(camera.cx, camera.cy);

  ivec2 nearest = ivec2(round(pixel));
  bool inside = all(greaterThanEqual(nearest, ivec2(0))) && all(lessThan(nearest, ivec2(width, height)));
  depth[i] = inside ? fetch(raw_depth, nearest.y * width + nearest.x) : 0.0;

  if (push.has_colour != 0u) {
    vec2 p = clamp(pixel, vec2(0.0), vec2(width, height) - 1.001);
    ivec2 q = ivec2(p);
    vec2 f = fract(p);
    int at = q.y * width + q.x;
    uint a = fetch(raw_colour, at), b = fetch(raw_colour, at + 1), c = fetch(raw_colour, at + width),
         d = fetch(raw_colour, at + width + 1);
    ivec3 rgb = ivec3(mix(mix(levels_of(a), levels_of(b), f.x), mix(levels_of(c), levels_of(d), f.x), f.y) + 0.5);
    // Beside pixels without colour there is none.
    colour[i] = uint(rgb.r | (rgb.g << 8) | (rgb.b << 16)) | (a & b & c & d & 0xff000000u);
  }
}
