// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Moments of SSIM, blurred along the rows. One thread per four pixels of a row and channel.
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
  ivec2 p = thread_place() * ivec2(4, 1);
  int width = int(push.width), pixels = width * int(push.height);
  uint channel = gl_GlobalInvocationID.z;
  if (p.x >= width || p.y >= int(push.height)) return;
  float gain = push.gain[channel], offset = push.offset[channel];
  int row = p.y * width, plane = int(channel) * pixels;
  vec4 sum_x = vec4(0.0), sum_y = vec4(0.0), sum_xx = vec4(0.0), sum_yy = vec4(0.0), sum_xy = vec4(0.0);
#define TAP(k, w)                                                                                   \
  {                                                                                                 \
    int column = p.x + k - 5, at = row + clamp(column, 0, width - 1);                               \
    float inside = column >= 0 && column < width ? 1.0 : 0.0;                                       \
    float x = inside * (gain * fetch(image, plane + at) + offset), y = inside * channel_of(fetch(target, at), channel); \
    sum_x += w * x;                                                                                 \
    sum_y += w * y;                                                                                 \
    sum_xx += w * (x * x);                                                                          \
    sum_yy += w * (y * y);                                                                          \
    sum_xy += w * (x * y);                                                                          \
  }
  TAPS
  uint to = channel * kLossMoments * uint(pixels) + uint(row + p.x), n = uint(pixels);
#define STORE(k)                      \
  if (p.x + k < width) {              \
    moments[to + uint(k)] = sum_x[k];           \
    moments[to + n + uint(k)] = sum_y[k];       \
    moments[to + 2u * n + uint(k)] = sum_xx[k]; \
    moments[to + 3u * n + uint(k)] = sum_yy[k]; \
    moments[to + 4u * n + uint(k)] = sum_xy[k]; \
  }
  STORE(0) STORE(1) STORE(2) STORE(3)
}
