// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Applies gains to the colors of a view: bilinear between the centers of kGainColumns x kGainRows cells of the image.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TextureExposePush push; };
WORDS(0, gains);  // vec3 by cell, row by row
WORDS(1, before);  // every push.words-th word is a color, the last of each group
layout(binding = 2, scalar) writeonly buffer Colors { uint colors[]; };  // same buffer

void main() {
  uint i = thread_index();
  if (i >= push.width * push.height) return;
  vec2 cells = vec2(kGainColumns, kGainRows);
  vec2 at = (vec2(i % push.width, i / push.width) + 0.5) / vec2(push.width, push.height) * cells - 0.5;
  at = clamp(at, vec2(0.0), cells - 1.001);
  uvec2 corner = uvec2(at);
  vec2 f = at - vec2(corner);
  int k = 3 * int(corner.y * kGainColumns + corner.x), row = 3 * int(kGainColumns);
  vec3 above = mix(vec3_at(gains, k), vec3_at(gains, k + 3), f.x);
  vec3 below = mix(vec3_at(gains, k + row), vec3_at(gains, k + row + 3), f.x);
  uint word = (i + 1u) * push.words - 1u;
  vec4 color = unpackUnorm4x8(fetch(before, int(word)));
  colors[word] = packUnorm4x8(vec4(color.rgb * mix(above, below, f.y), color.a));
}
