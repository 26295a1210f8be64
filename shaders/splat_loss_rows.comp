// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Moments of SSIM, blurred along the rows. One thread per pixel and channel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splat_loss.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SplatLossPush push; };
FLOATS(0, image);
WORDS(1, target);
layout(binding = 2, scalar) writeonly buffer Moments { float moments[]; };

void main() {
  ivec2 p = thread_place();
  int width = int(push.width), pixels = width * int(push.height);
  uint channel = gl_GlobalInvocationID.z;
  if (p.x >= width || p.y >= int(push.height)) return;
  float gain = push.gain[channel], offset = push.offset[channel];
  int row = p.y * width, plane = int(channel) * pixels;
  vec4 sum = vec4(0.0);
  float product = 0.0;
#define TAP(k, w)                                                                 \
  {                                                                               \
    int at = row + clamp(p.x + k, 0, width - 1);                                  \
    float weight = p.x + k >= 0 && p.x + k < width ? w : 0.0;                     \
    float x = gain * fetch(image, plane + at) + offset, y = channel_of(fetch(target, at), channel); \
    sum += weight * vec4(x, y, x * x, y * y);                                     \
    product += weight * x * y;                                                    \
  }
  TAPS
  uint to = channel * kLossMoments * uint(pixels) + uint(row + p.x);
  moments[to] = sum.x;
  moments[to + uint(pixels)] = sum.y;
  moments[to + 2u * uint(pixels)] = sum.z;
  moments[to + 3u * uint(pixels)] = sum.w;
  moments[to + 4u * uint(pixels)] = product;
}
