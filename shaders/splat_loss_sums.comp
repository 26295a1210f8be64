// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Sums over a row: loss, squared error, and gradients of the exposure. One thread per row.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splat_loss.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatLossPush push; };
FLOATS(0, image);
WORDS(1, target);
FLOATS(2, depth);
FLOATS(3, structure);
FLOATS(4, gradients);
layout(binding = 5, scalar) writeonly buffer Sums { float sums[]; };

void main() {
  int row = int(thread_index()), width = int(push.width), pixels = width * int(push.height);
  if (row >= int(push.height)) return;
  float loss = 0.0, squared = 0.0;
  vec3 of_gain = vec3(0.0), of_offset = vec3(0.0);
  for (int i = row * width; i < (row + 1) * width; ++i) {
    vec3 color = vec3(fetch(image, i), fetch(image, i + pixels), fetch(image, i + 2 * pixels));
    uint word = fetch(target, i);
    vec3 off = push.gain * color + push.offset - vec3(channel_of(word, 0u), channel_of(word, 1u), channel_of(word, 2u));
    vec3 similar = vec3(fetch(structure, i), fetch(structure, i + pixels), fetch(structure, i + 2 * pixels));
    float z = fetch(depth, i), opacity = fetch(image, i + 3 * pixels);
    loss += dot((1.0 - push.structure) * abs(off) + push.structure * (1.0 - similar), vec3(1.0 / 3.0));
    loss += z > 0.0 ? push.depth * abs(fetch(image, i + 4 * pixels) - z * opacity) + push.opacity * (1.0 - opacity) : 0.0;
    squared += dot(off, off);
    vec3 g = vec3(fetch(gradients, i), fetch(gradients, i + pixels), fetch(gradients, i + 2 * pixels)) / push.gain;
    of_gain += g * color;
    of_offset += g;
  }
  uint to = uint(row) * kLossSums;
  sums[to] = loss;
  sums[to + 1u] = squared;
  sums[to + 2u] = of_gain.x;
  sums[to + 3u] = of_gain.y;
  sums[to + 4u] = of_gain.z;
  sums[to + 5u] = of_offset.x;
  sums[to + 6u] = of_offset.y;
  sums[to + 7u] = of_offset.z;
}
