// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Packs what the photometric term reads of a pixel: its four neighbours' intensities and its depth, see surface.h.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfacePackPush push; };
FLOATS(0, intensity);
PAIRS(1, points);
layout(binding = 2, scalar) writeonly buffer Packed { uvec2 packed_pixels[]; };

uint code(float v) { return v < 0.0 ? 0u : 1u + uint(int(v * 4094.0 + 0.5)); }

void main() {
  ivec2 p = thread_place();
  int width = int(push.width), height = int(push.height), i = p.y * width + p.x;
  if (p.x >= width || p.y >= height) return;
  if (p.x + 1 == width || p.y + 1 == height) {
    packed_pixels[i] = uvec2(0);
    return;
  }
  uint depth = uint(int(min(uintBitsToFloat(fetch(points, i).x) * 1000.0 + 0.5, 65535.0)));
  uvec2 upper = uvec2(code(fetch(intensity, i)), code(fetch(intensity, i + 1)));
  uvec2 lower = uvec2(code(fetch(intensity, i + width)), code(fetch(intensity, i + width + 1)));
  packed_pixels[i] = uvec2(upper.x | (upper.y << 12) | ((depth & 0xffu) << 24),
                           lower.x | (lower.y << 12) | ((depth >> 8) << 24));
}
