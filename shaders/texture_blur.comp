// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Low frequencies of a view's color at a quarter of the size: means over 12 x 12 pixels, restricted to pixels on the
// surface of the center pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TexturePreparePush push; };
PAIRS(0, pixels);
layout(binding = 1, scalar) writeonly buffer Blurred { uint blurred[]; };

void main() {
  uvec2 size = uvec2(push.camera.width >> 2, push.camera.height >> 2);
  uint i = thread_index();
  if (i >= size.x * size.y) return;
  ivec2 first = 4 * ivec2(i % size.x, i / size.x) - 4, last = ivec2(push.camera.width, push.camera.height) - 1;
  uvec2 middle = fetch(pixels, min(first.y + 6, last.y) * (last.x + 1) + min(first.x + 6, last.x));
  float z = unpackHalf2x16(middle.x).x, reach = 0.03 + 0.05 * z;
  vec3 sum = vec3(0.0);
  float total = 0.0;
  for (int k = 0; k < 144; ++k) {
    ivec2 p = clamp(first + ivec2(k % 12, k / 12), ivec2(0), last);
    uvec2 word = fetch(pixels, p.y * (last.x + 1) + p.x);
    float there = unpackHalf2x16(word.x).x;
    float w = z == 0.0 || abs(there - z) < reach ? 1.0 : 0.0;
    sum += w * color_of(word.y);
    total += w;
  }
  blurred[i] = packUnorm4x8(vec4(total > 0.0 ? sum / total : color_of(middle.y), 1.0));
}
