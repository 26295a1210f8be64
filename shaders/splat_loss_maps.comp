// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Derivatives of SSIM, blurred along the rows. One thread per four pixels of a row and channel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splat_loss.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SplatLossPush push; };
FLOATS(0, maps);
layout(binding = 1, scalar) writeonly buffer Blurred { float blurred[]; };

void main() {
  ivec2 p = thread_place() * ivec2(4, 1);
  int width = int(push.width), pixels = width * int(push.height);
  if (p.x >= width || p.y >= int(push.height)) return;
  int row = int(gl_GlobalInvocationID.z * kLossMaps) * pixels + p.y * width;
  vec4 of_x = vec4(0.0), of_xx = vec4(0.0), of_xy = vec4(0.0);
#define TAP(k, w)                                                       \
  {                                                                     \
    int column = p.x + k - 5, at = row + clamp(column, 0, width - 1);   \
    float inside = column >= 0 && column < width ? 1.0 : 0.0;           \
    of_x += w * (inside * fetch(maps, at));                             \
    of_xx += w * (inside * fetch(maps, at + pixels));                   \
    of_xy += w * (inside * fetch(maps, at + 2 * pixels));               \
  }
  TAPS
  uint to = uint(row + p.x), n = uint(pixels);
#define STORE(k)                                 \
  if (p.x + k < width) {                         \
    blurred[to + uint(k)] = of_x[k];             \
    blurred[to + n + uint(k)] = of_xx[k];        \
    blurred[to + 2u * n + uint(k)] = of_xy[k];   \
  }
  STORE(0) STORE(1) STORE(2) STORE(3)
}
