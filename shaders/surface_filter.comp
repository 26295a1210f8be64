// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Drops measurements out of range and flying pixels, and smooths what is left without crossing edges (Tomasi & Manduchi
// 1998). `clean` is for fusion, which averages by itself; `smooth` for normals and alignment.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceFilterPush push; };
layout(binding = 0, scalar) readonly buffer Depth { float depth[]; };
layout(binding = 1, scalar) writeonly buffer Clean { float clean[]; };
layout(binding = 2, scalar) writeonly buffer Smooth { float smooth_depth[]; };

// A pixel between a nearer and a farther one lies on no surface: the sensor mixed both.
bool between(float a, float z, float b, float jump) {
  return a > 0.0 && b > 0.0 && min(abs(a - z), abs(b - z)) > jump && (a < z) != (b < z);
}

void main() {
  int width = int(push.width), height = int(push.height);
  int i = int(gl_GlobalInvocationID.x);
  if (i >= width * height) return;
  ivec2 p = ivec2(i % width, i / width);
  float z = depth[i];
  if (!(z >= push.min_depth && z <= push.max_depth)) z = 0.0;

  float sigma = depth_noise(z);
  int left = i - (p.x > 0 ? 1 : 0), right = i + (p.x < width - 1 ? 1 : 0);
  int up = i - (p.y > 0 ? width : 0), down = i + (p.y < height - 1 ? width : 0);
  float jump = push.edge_slope * sigma;
  if (between(depth[left], z, depth[right], jump) || between(depth[up], z, depth[down], jump)) z = 0.0;
  clean[i] = z;

  float inverse = 1.0 / (push.range * sigma);
  float sum = 0.0, weights = 0.0;
  for (int y = max(p.y - 2, 0); y <= min(p.y + 2, height - 1); ++y) {
    for (int x = max(p.x - 2, 0); x <= min(p.x + 2, width - 1); ++x) {
      float other = depth[y * width + x];
      float e = (other - z) * inverse;
      vec2 d = vec2(x - p.x, y - p.y);
      float w = other > 0.0 ? exp(dot(d, d) * push.spatial - 0.5 * e * e) : 0.0;
      sum += w * (other - z);
      weights += w;
    }
  }
  smooth_depth[i] = z > 0.0 ? z + sum / max(weights, 1e-6) : 0.0;
}
