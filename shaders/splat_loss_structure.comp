// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// SSIM by pixel and channel from the moments, and its derivatives by three of them. One thread per four pixels of a
// column and channel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splat_loss.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SplatLossPush push; };
FLOATS(0, moments);
layout(binding = 1, scalar) writeonly buffer Maps { float maps[]; };
layout(binding = 2, scalar) writeonly buffer Structure { float structure[]; };  // SSIM, a plane per channel

void main() {
  ivec2 p = thread_place() * ivec2(1, 4);
  int width = int(push.width), height = int(push.height), pixels = width * height;
  int channel = int(gl_GlobalInvocationID.z);
  if (p.x >= width || p.y >= height) return;
  int plane = channel * int(kLossMoments) * pixels + p.x;
  vec4 x = vec4(0.0), y = vec4(0.0), xx = vec4(0.0), yy = vec4(0.0), xy = vec4(0.0);
#define TAP(k, w)                                                             \
  {                                                                           \
    int row = p.y + k - 5, at = plane + clamp(row, 0, height - 1) * width;    \
    float inside = row >= 0 && row < height ? 1.0 : 0.0;                      \
    x += w * (inside * fetch(moments, at));                                   \
    y += w * (inside * fetch(moments, at + pixels));                          \
    xx += w * (inside * fetch(moments, at + 2 * pixels));                     \
    yy += w * (inside * fetch(moments, at + 3 * pixels));                     \
    xy += w * (inside * fetch(moments, at + 4 * pixels));                     \
  }
  TAPS
  const float c1 = 0.0001, c2 = 0.0009;
  vec4 a = 2.0 * x * y + c1, b = 2.0 * (xy - x * y) + c2, c = x * x + y * y + c1, d = xx - x * x + yy - y * y + c2;
  vec4 s = a * b / (c * d), of_x = 2.0 * y * (b - a) / (c * d) - 2.0 * x * s * (1.0 / c - 1.0 / d), of_xx = -s / d,
       of_xy = 2.0 * a / (c * d);
  uint to = uint(channel * int(kLossMaps) * pixels + p.y * width + p.x), n = uint(pixels),
       to_structure = uint(channel * pixels + p.y * width + p.x);
#define STORE(k)                                       \
  if (p.y + k < height) {                              \
    uint row = uint(k * width);                        \
    maps[to + row] = of_x[k];                          \
    maps[to + n + row] = of_xx[k];                     \
    maps[to + 2u * n + row] = of_xy[k];                \
    structure[to_structure + row] = s[k];              \
  }
  STORE(0) STORE(1) STORE(2) STORE(3)
}
