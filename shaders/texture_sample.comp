// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a view sees at some points: for the comparison of exposures.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TextureSamplePush push; };
layout(binding = 0, scalar) readonly buffer Texels { Texel texels[]; };
layout(binding = 1, scalar) readonly buffer Views { TextureView views[]; };
layout(binding = 2, scalar) writeonly buffer Colours { uint colours[]; };  // 0: not seen

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.points) return;
  Texel t = texels[i];
  vec2 pixel;
  TextureView view = views[push.view];
  float w = view_weight(view, push.camera, t.position, unpack_normal(t.normal), push.tolerance, pixel);
  vec2 seen = unpackHalf2x16(ViewPixels(view.pixels).v[uint(pixel.y + 0.5) * push.camera.width + uint(pixel.x + 0.5)].x);
  colours[i] = w > 0.0 && seen.y > 0.5 ? packUnorm4x8(vec4(smooth_colour(view, push.camera, pixel), 1.0)) : 0u;
}
