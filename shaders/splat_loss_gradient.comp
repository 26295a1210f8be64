// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gradient of the loss by pixel: color, opacity and depth. One thread per four pixels of a column.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splat_loss.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SplatLossPush push; };
FLOATS(0, image);
WORDS(1, target);
FLOATS(2, depth);  // of the surface, meters; 0: none
FLOATS(3, blurred);
layout(binding = 4, scalar) writeonly buffer Gradients { float gradients[]; };

/// Values of four pixels of a column, from `at`; repeats the last beyond the image.
#define FOUR(buffer, at, y)                                                                         \
  vec4(fetch(buffer, at), fetch(buffer, at + min(1, height - 1 - y) * width),                       \
       fetch(buffer, at + min(2, height - 1 - y) * width), fetch(buffer, at + min(3, height - 1 - y) * width))

void store(uint at, vec4 values, int y) {
#define STORE(k) \
  if (y + k < int(push.height)) gradients[at + uint(k) * push.width] = values[k];
  STORE(0) STORE(1) STORE(2) STORE(3)
}

vec4 of_color(int channel, ivec2 p, int width, int height, vec4 y) {
  int pixels = width * height, i = p.y * width + p.x, column = channel * int(kLossMaps) * pixels + p.x;
  vec4 of_x = vec4(0.0), of_xx = vec4(0.0), of_xy = vec4(0.0);
#define TAP(k, w)                                                          \
  {                                                                        \
    int row = p.y + k - 5, at = column + clamp(row, 0, height - 1) * width; \
    float inside = row >= 0 && row < height ? 1.0 : 0.0;                   \
    of_x += w * (inside * fetch(blurred, at));                             \
    of_xx += w * (inside * fetch(blurred, at + pixels));                   \
    of_xy += w * (inside * fetch(blurred, at + 2 * pixels));               \
  }
  TAPS
  float gain = push.gain[channel];
  vec4 x = gain * FOUR(image, channel * pixels + i, p.y) + push.offset[channel];
  vec4 of_structure = of_x + 2.0 * x * of_xx + y * of_xy;
  return gain * ((1.0 - push.structure) * sign(x - y) - push.structure * of_structure) / float(3 * pixels);
}

void main() {
  ivec2 p = thread_place() * ivec2(1, 4);
  int width = int(push.width), height = int(push.height), pixels = width * height, i = p.y * width + p.x;
  if (p.x >= width || p.y >= height) return;
  uvec4 word = uvec4(fetch(target, i), fetch(target, i + min(1, height - 1 - p.y) * width),
                     fetch(target, i + min(2, height - 1 - p.y) * width), fetch(target, i + min(3, height - 1 - p.y) * width));
  for (int channel = 0; channel < 3; ++channel) {
    vec4 y = vec4(word >> uint(8 * channel) & 255u) / 255.0;
    store(uint(i + channel * pixels), of_color(channel, p, width, height, y), p.y);
  }
  vec4 z = FOUR(depth, i, p.y), opacity = FOUR(image, i + 3 * pixels, p.y), error = FOUR(image, i + 4 * pixels, p.y) - z * opacity;
  vec4 has_surface = vec4(greaterThan(z, vec4(0.0))), of_depth = has_surface * (push.depth / float(pixels)) * sign(error);
  store(uint(i + 3 * pixels), -z * of_depth - has_surface * (push.opacity / float(pixels)), p.y);
  store(uint(i + 4 * pixels), of_depth, p.y);
}
