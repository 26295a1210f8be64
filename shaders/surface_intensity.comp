// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Luminance in 0..1, the mean of factor x factor pixels; -1 if any of them is over- or underexposed.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceIntensityPush push; };
WORDS(0, source);  // fusion image, or intensities of the finer level
layout(binding = 1, scalar) writeonly buffer Intensity { float intensity[]; };

float read(int i) {
  if (push.from_color == 0u) return uintBitsToFloat(fetch(source, i));
  uint word = fetch(source, 2 * i + 1);
  vec3 rgb = vec3(ivec3(word & 0xffu, (word >> 8) & 0xffu, (word >> 16) & 0xffu));
  return is_exposed(rgb) ? luminance(rgb) : -1.0;
}

void main() {
  ivec2 p = thread_place();
  int width = int(push.width), f = int(push.factor), fine_width = int(push.fine_width);
  if (p.x >= width || p.y >= int(push.height)) return;
  int at = f * (p.y * fine_width + p.x);
  float a = read(at), b = read(at + f - 1), c = read(at + (f - 1) * fine_width), d = read(at + (f - 1) * (fine_width + 1));
  intensity[p.y * width + p.x] = min(min(a, b), min(c, d)) < 0.0 ? -1.0 : 0.25 * (a + b + c + d);
}
