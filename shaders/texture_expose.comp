// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Applies gains to the colors of a view: bilinear between the centers of kGainColumns x kGainRows cells of the image.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TextureExposePush push; };
layout(binding = 0, scalar) readonly buffer Gains { vec3 gains[]; };  // row by row
layout(binding = 1, scalar) buffer Colors { uint colors[]; };  // every push.words-th word, the last of each group

void main() {
  uint i = thread_index();
  if (i >= push.width * push.height) return;
  vec2 cells = vec2(kGainColumns, kGainRows);
  vec2 at = (vec2(i % push.width, i / push.width) + 0.5) / vec2(push.width, push.height) * cells - 0.5;
  at = clamp(at, vec2(0.0), cells - 1.001);
  uvec2 corner = uvec2(at);
  vec2 f = at - vec2(corner);
  uint k = corner.y * kGainColumns + corner.x;
  vec3 above = mix(gains[k], gains[k + 1u], f.x), below = mix(gains[k + kGainColumns], gains[k + kGainColumns + 1u], f.x);
  uint word = (i + 1u) * push.words - 1u;
  vec4 color = unpackUnorm4x8(colors[word]);
  colors[word] = packUnorm4x8(vec4(color.rgb * mix(above, below, f.y), color.a));
}
