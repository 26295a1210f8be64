// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Derivatives of SSIM, blurred along the rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splat_loss.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SplatLossPush push; };
FLOATS(0, maps);
layout(binding = 1, scalar) writeonly buffer Blurred { float blurred[]; };

void main() {
  ivec2 p = thread_place();
  int width = int(push.width), pixels = width * int(push.height);
  if (p.x >= width || p.y >= int(push.height)) return;
  int row = int(gl_GlobalInvocationID.z * kLossMaps) * pixels + p.y * width;
  vec3 sum = vec3(0.0);
#define TAP(k, w)                                                                                      \
  {                                                                                                    \
    int at = row + clamp(p.x + k, 0, width - 1);                                                       \
    float weight = p.x + k >= 0 && p.x + k < width ? w : 0.0;                                          \
    sum += weight * vec3(fetch(maps, at), fetch(maps, at + pixels), fetch(maps, at + 2 * pixels));      \
  }
  TAPS
  uint to = uint(row + p.x);
  blurred[to] = sum.x;
  blurred[to + uint(pixels)] = sum.y;
  blurred[to + 2u * uint(pixels)] = sum.z;
}
