// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// SSIM by pixel and channel from the moments, and its derivatives by three of them.
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
  ivec2 p = thread_place();
  int width = int(push.width), height = int(push.height), pixels = width * height;
  int channel = int(gl_GlobalInvocationID.z);
  if (p.x >= width || p.y >= height) return;
  int plane = channel * int(kLossMoments) * pixels + p.x;
  vec4 sum = vec4(0.0);
  float xy = 0.0;
#define TAP(k, w)                                                                                            \
  {                                                                                                          \
    int at = plane + clamp(p.y + k, 0, height - 1) * width;                                                  \
    float weight = p.y + k >= 0 && p.y + k < height ? w : 0.0;                                               \
    sum += weight * vec4(fetch(moments, at), fetch(moments, at + pixels), fetch(moments, at + 2 * pixels),   \
                         fetch(moments, at + 3 * pixels));                                                   \
    xy += weight * fetch(moments, at + 4 * pixels);                                                          \
  }
  TAPS
  const float c1 = 0.0001, c2 = 0.0009;
  float x = sum.x, y = sum.y, a = 2.0 * x * y + c1, b = 2.0 * (xy - x * y) + c2, c = x * x + y * y + c1,
        d = sum.z - x * x + sum.w - y * y + c2;
  float s = a * b / (c * d);
  uint to = uint(channel * int(kLossMaps) * pixels + p.y * width + p.x);
  maps[to] = 2.0 * y * (b - a) / (c * d) - 2.0 * x * s * (1.0 / c - 1.0 / d);
  maps[to + uint(pixels)] = -s / d;
  maps[to + 2u * uint(pixels)] = 2.0 * a / (c * d);
  structure[channel * pixels + p.y * width + p.x] = s;
}
