// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Drops measurements out of range and flying pixels, and smooths what is left without crossing edges (Tomasi & Manduchi
// 1998, with Tukey's biweight in place of the Gaussian of depth: it needs no exponential and ends at edges). `fusion`
// holds (depth bits, colour), not smoothed, since fusion averages by itself; `smooth` is for normals and alignment. One
// thread does four pixels of a row, which share most of what they read.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/surface.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SurfaceFilterPush push; };
layout(binding = 0, scalar) readonly buffer Depth { float depth[]; };
layout(binding = 1, scalar) readonly buffer Colour { uint colour[]; };
layout(binding = 2, scalar) writeonly buffer Fusion { uvec2 fusion[]; };
layout(binding = 3, scalar) writeonly buffer Smooth { float smooth_depth[]; };

int width, height;

vec4 depth_clamped(ivec4 x, int row) {
  ivec4 at = row + clamp(x, ivec4(0), ivec4(width - 1));
  return vec4(depth[at.x], depth[at.y], depth[at.z], depth[at.w]);
}

// Weighted differences to the centres, summed over one row of five neighbours.
void add_row(int row, ivec4 x, vec4 z, vec4 inverse, float dy2, inout vec4 sum, inout vec4 weights) {
  vec4 a = depth_clamped(x - 2, row), b = depth_clamped(x + 2, row);
  for (int dx = -2; dx <= 2; ++dx) {
    vec4 other = dx == -2 ? a : dx == -1 ? vec4(a.yzw, b.x) : dx == 0 ? vec4(a.zw, b.xy) : dx == 1 ? vec4(a.w, b.xyz) : b;
    vec4 e = (other - z) * inverse;
    vec4 w = max(1.0 - e * e, vec4(0.0));
    w *= w * exp((float(dx * dx) + dy2) * push.spatial);
    sum += w * (other - z);
    weights += w;
  }
}

// A pixel between a nearer and a farther one lies on no surface: the sensor mixed both.
bvec4 between(vec4 a, vec4 z, vec4 b, vec4 jump) {
  vec4 da = a - z, db = b - z;
  vec4 crossed = step(da * db, vec4(-1e-12)) * step(vec4(1e-6), min(a, b)) * step(jump, min(abs(da), abs(db)));
  return greaterThan(crossed, vec4(0.5));
}

void main() {
  width = int(push.width);
  height = int(push.height);
  int columns = (width + 3) / 4;
  int i = int(gl_GlobalInvocationID.x);
  if (i >= columns * height) return;
  int y = i / columns;
  ivec4 x = 4 * (i % columns) + ivec4(0, 1, 2, 3);
  int row = y * width, up = max(y - 1, 0) * width, down = min(y + 1, height - 1) * width;

  vec4 z = depth_clamped(x, row);
  z = mix(vec4(0.0), z, greaterThanEqual(z, vec4(push.min_depth)));
  z = mix(vec4(0.0), z, lessThanEqual(z, vec4(push.max_depth)));
  vec4 sigma = 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4);  // depth_noise
  vec4 jump = push.edge_slope * sigma;
  z = mix(z, vec4(0.0), between(depth_clamped(x - 1, row), z, depth_clamped(x + 1, row), jump));
  z = mix(z, vec4(0.0), between(depth_clamped(x, up), z, depth_clamped(x, down), jump));

  vec4 inverse = 1.0 / (push.range * sigma);
  vec4 sum = vec4(0.0), weights = vec4(0.0);
  add_row(max(y - 2, 0) * width, x, z, inverse, 4.0, sum, weights);
  add_row(up, x, z, inverse, 1.0, sum, weights);
  add_row(row, x, z, inverse, 0.0, sum, weights);
  add_row(down, x, z, inverse, 1.0, sum, weights);
  add_row(min(y + 2, height - 1) * width, x, z, inverse, 4.0, sum, weights);
  vec4 smoothed = mix(vec4(0.0), z + sum / max(weights, vec4(1e-6)), greaterThan(z, vec4(0.0)));

  uvec4 bits = floatBitsToUint(z);
  ivec4 at = row + min(x, ivec4(width - 1));
  fusion[at.x] = uvec2(bits.x, colour[at.x]);
  fusion[at.y] = uvec2(bits.y, colour[at.y]);
  fusion[at.z] = uvec2(bits.z, colour[at.z]);
  fusion[at.w] = uvec2(bits.w, colour[at.w]);
  smooth_depth[at.x] = smoothed.x;
  smooth_depth[at.y] = smoothed.y;
  smooth_depth[at.z] = smoothed.z;
  smooth_depth[at.w] = smoothed.w;
}
