// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Converts a frame to a view, with a confidence that each pixel shows the surface at its depth. Color and depth images
// are aligned only within a few pixels, so depth edges and the image border get a lower confidence. Missing depth is
// filled from the map.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TexturePreparePush push; };
PAIRS(0, fusion);  // depth bits, color
PAIRS(1, model);   // raycast of the map at half the size: depth bits
layout(binding = 2, scalar) writeonly buffer Pixels { uvec2 pixels[]; };

const int kNearOffset = 2, kFarOffset = 5;  // pixels
const float kBorder = 24.0;     // pixels

float depth_at(ivec2 p, ivec2 size) {
  p = clamp(p, ivec2(0), size - 1);
  return uintBitsToFloat(fetch(fusion, p.y * size.x + p.x).x);
}

// True if the surface has a discontinuity between two pixels on opposite sides; on a plane their depth differences
// cancel.
bool breaks(ivec2 p, ivec2 step_p, ivec2 size, float z, float jump) {
  float a = depth_at(p + step_p, size), b = depth_at(p - step_p, size);
  return (a > 0.0 && b > 0.0 && abs(a + b - 2.0 * z) > jump) || ((a == 0.0) != (b == 0.0));
}

void main() {
  uint i = thread_index();
  ivec2 size = ivec2(push.camera.width, push.camera.height);
  if (int(i) >= size.x * size.y) return;
  ivec2 p = ivec2(int(i) % size.x, int(i) / size.x);
  uvec2 word = fetch(fusion, int(i));
  float z = uintBitsToFloat(word.x), jump = 0.03 + 4.0 * depth_noise(z);
  bool near = false, far = false;
  for (int k = 0; k < 4; ++k) {
    ivec2 direction = ivec2(k == 1 ? 0 : 1, k == 0 ? 0 : k == 3 ? -1 : 1);
    near = near || breaks(p, kNearOffset * direction, size, z, jump);
    far = far || breaks(p, kFarOffset * direction, size, z, jump);
  }
  ivec2 to_border = min(p, size - 1 - p);
  float confidence = clamp(float(min(to_border.x, to_border.y)) / kBorder, 0.02, 1.0);
  confidence *= near ? 0.02 : far ? 0.2 : 1.0;
  // Overexposed pixels have lost their color.
  vec3 c = color_of(word.y);
  confidence *= min(min(c.r, c.g), c.b) > 0.985 ? 0.1 : 1.0;
  ivec2 half_size = size >> 1, h = min(p >> 1, half_size - 1);
  float there = uintBitsToFloat(fetch(model, h.y * half_size.x + h.x).x);
  confidence *= z > 0.0 ? 1.0 : 0.05;
  z = z > 0.0 ? z : there;
  pixels[i] = uvec2(packHalf2x16(vec2((word.y >> 24) != 0u ? z : 0.0, confidence)), word.y);
}
