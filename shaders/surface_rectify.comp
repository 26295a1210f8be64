// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Removes lens distortion: nearest measurement for depth (an average across an edge is no surface), bilinear for colour.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceRectifyPush push; };
layout(binding = 0, scalar) readonly buffer RawDepth { float raw_depth[]; };
layout(binding = 1, scalar) readonly buffer RawColour { uint raw_colour[]; };
layout(binding = 2, scalar) writeonly buffer Depth { float depth[]; };
layout(binding = 3, scalar) writeonly buffer Colour { uint colour[]; };

void main() {
  uint width = push.camera.width, height = push.camera.height;
  uint i = thread_index();
  if (i >= width * height) return;
  vec2 pixel = bend(push.lens, ray_through(push.camera, vec2(i % width, i / width)).xy) * vec2(push.camera.fx, push.camera.fy) + vec2(push.camera.cx, push.camera.cy);

  ivec2 nearest = ivec2(round(pixel));
  bool inside = all(greaterThanEqual(nearest, ivec2(0))) && all(lessThan(nearest, ivec2(width, height)));
  depth[i] = inside ? raw_depth[nearest.y * int(width) + nearest.x] : 0.0;

  if (push.has_colour != 0u) {
    vec2 p = clamp(pixel, vec2(0.0), vec2(width, height) - 1.001);
    uvec2 q = uvec2(p);
    vec2 f = fract(p);
    uint at = q.y * width + q.x;
    vec4 top = mix(unpackUnorm4x8(raw_colour[at]), unpackUnorm4x8(raw_colour[at + 1u]), f.x);
    vec4 bottom = mix(unpackUnorm4x8(raw_colour[at + width]), unpackUnorm4x8(raw_colour[at + width + 1u]), f.x);
    colour[i] = packUnorm4x8(mix(top, bottom, f.y));
  }
}
