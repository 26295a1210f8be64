// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gradient of the loss by pixel: color, opacity and depth.
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

float of_color(int channel, ivec2 p, int width, int height) {
  int pixels = width * height, i = p.y * width + p.x, column = channel * int(kLossMaps) * pixels + p.x;
  vec3 sum = vec3(0.0);
#define TAP(k, w)                                                                                          \
  {                                                                                                        \
    int at = column + clamp(p.y + k, 0, height - 1) * width;                                               \
    float weight = p.y + k >= 0 && p.y + k < height ? w : 0.0;                                             \
    sum += weight * vec3(fetch(blurred, at), fetch(blurred, at + pixels), fetch(blurred, at + 2 * pixels)); \
  }
  TAPS
  float gain = push.gain[channel];
  float x = gain * fetch(image, channel * pixels + i) + push.offset[channel], y = channel_of(fetch(target, i), uint(channel));
  float of_structure = sum.x + 2.0 * x * sum.y + y * sum.z;
  return gain * ((1.0 - push.structure) * sign(x - y) - push.structure * of_structure) / float(3 * pixels);
}

void main() {
  ivec2 p = thread_place();
  int width = int(push.width), height = int(push.height), pixels = width * height, i = p.y * width + p.x;
  if (p.x >= width || p.y >= height) return;
  gradients[i] = of_color(0, p, width, height);
  gradients[i + pixels] = of_color(1, p, width, height);
  gradients[i + 2 * pixels] = of_color(2, p, width, height);
  float z = fetch(depth, i), opacity = fetch(image, i + 3 * pixels), error = fetch(image, i + 4 * pixels) - z * opacity;
  float of_depth = z > 0.0 ? push.depth * sign(error) / float(pixels) : 0.0;
  gradients[i + 3 * pixels] = -z * of_depth - (z > 0.0 ? push.opacity / float(pixels) : 0.0);
  gradients[i + 4 * pixels] = of_depth;
}
