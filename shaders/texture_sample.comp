// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Samples the color of a view at some points, for exposure compensation.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TextureSamplePush push; };
layout(binding = 0, scalar) readonly buffer Texels { Texel texels[]; };
layout(binding = 1, scalar) readonly buffer Views { TextureView views[]; };  // a single view
layout(binding = 2, scalar) writeonly buffer Colors { uint colors[]; };  // 0: not visible

const float kSure = 0.1;  // pixels at edges, slanted or moving surfaces have less

void main() {
  uint i = thread_index();
  if (i >= push.points) return;
  Texel t = texels[i];
  vec2 pixel;
  TextureView view = views[0];
  float w = view_weight(view, push.camera, push.color, t.position, unpack_normal(t.normal), push.tolerance, pixel);
  vec3 color = push.sharp != 0u ? sharp_color(view, push.camera, pixel) : smooth_color(view, push.camera, pixel);
  float z = transform(view.camera_from_world, t.position).z;
  colors[i] = w * max(z * z, 0.25) > kSure ? packUnorm4x8(vec4(color, 1.0)) : 0u;
}
