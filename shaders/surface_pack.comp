// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Packs what the photometric term reads of a pixel: its four neighbours' intensities and its depth, see surface.h.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfacePackPush push; };
layout(binding = 0, scalar) readonly buffer Intensity { float intensity[]; };
layout(binding = 1, scalar) readonly buffer Points { uvec2 points[]; };
layout(binding = 2, scalar) writeonly buffer Packed { uvec2 packed_pixels[]; };

uint code(float v) { return v < 0.0 ? 0u : 1u + uint(int(v * 4094.0 + 0.5)); }

void main() {
  uint i = thread_index();
  if (i >= push.width * push.height) return;
  uint x = i % push.width, y = i / push.width;
  if (x + 1u == push.width || y + 1u == push.height) {
    packed_pixels[i] = uvec2(0);
    return;
  }
  uint depth = uint(int(min(uintBitsToFloat(points[i].x) * 1000.0 + 0.5, 65535.0)));
  packed_pixels[i] = uvec2(code(intensity[i]) | (code(intensity[i + 1u]) << 12) | ((depth & 0xffu) << 24),
                           code(intensity[i + push.width]) | (code(intensity[i + push.width + 1u]) << 12) | ((depth >> 8) << 24));
}
