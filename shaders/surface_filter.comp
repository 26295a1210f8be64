// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Drops measurements out of range and flying pixels, and smooths what is left without crossing edges (Tomasi & Manduchi
// 1998, with Tukey's biweight in place of the Gaussian of depth: it needs no exponential and ends at edges). `fusion`
// holds (depth bits, colour), not smoothed, since fusion averages by itself; `smooth` is for normals and alignment. One
// thread does four pixels of a row, which share most of what they read.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceFilterPush push; };
FLOATS(0, depth);
WORDS(1, colour);
layout(binding = 2, scalar) writeonly buffer Fusion { uvec2 fusion[]; };
layout(binding = 3, scalar) writeonly buffer Smooth { float smooth_depth[]; };

int width, height;

vec4 depth_clamped(ivec4 x, int row) {
  ivec4 at = row + clamp(x, ivec4(0), ivec4(width - 1));
  return vec4(fetch(depth, at.x), fetch(depth, at.y), fetch(depth, at.z), fetch(depth, at.w));
}

// Weighted differences of inverse depth to the centres, summed over one row of five neighbours; a and b hold eight pixels
// of the row, and g the spatial weights at distances 0, 1 and 2.
void add_row(vec4 a, vec4 b, vec4 q, vec4 inverse, vec3 g, inout vec4 sum, inout vec4 weights) {
  vec4 d0 = a - q, d1 = vec4(a.yzw, b.x) - q, d2 = vec4(a.zw, b.xy) - q, d3 = vec4(a.w, b.xyz) - q, d4 = b - q;
  vec4 e0 = d0 * inverse, e1 = d1 * inverse, e2 = d2 * inverse, e3 = d3 * inverse, e4 = d4 * inverse;
  vec4 w0 = max(1.0 - e0 * e0, vec4(0.0)), w1 = max(1.0 - e1 * e1, vec4(0.0)), w2 = max(1.0 - e2 * e2, vec4(0.0));
  vec4 w3 = max(1.0 - e3 * e3, vec4(0.0)), w4 = max(1.0 - e4 * e4, vec4(0.0));
  w0 *= w0 * g.z;
  w1 *= w1 * g.y;
  w2 *= w2 * g.x;
  w3 *= w3 * g.y;
  w4 *= w4 * g.z;
  sum += w0 * d0 + w1 * d1 + w2 * d2 + w3 * d3 + w4 * d4;
  weights += w0 + w1 + w2 + w3 + w4;
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
  ivec2 place = thread_place();
  if (4 * place.x >= width || place.y >= height) return;
  int y = place.y;
  // The last four of a row lie over those before them where four do not divide it.
  ivec4 x = min(4 * place.x, width - 4) + ivec4(0, 1, 2, 3);
  int row = y * width, up = max(y - 1, 0) * width, down = min(y + 1, height - 1) * width;

  int far_up = max(y - 2, 0) * width, far_down = min(y + 2, height - 1) * width;
  vec4 a0 = depth_clamped(x - 2, far_up), b0 = depth_clamped(x + 2, far_up);
  vec4 a1 = depth_clamped(x - 2, up), b1 = depth_clamped(x + 2, up);
  vec4 a2 = depth_clamped(x - 2, row), b2 = depth_clamped(x + 2, row);
  vec4 a3 = depth_clamped(x - 2, down), b3 = depth_clamped(x + 2, down);
  vec4 a4 = depth_clamped(x - 2, far_down), b4 = depth_clamped(x + 2, far_down);

  vec4 z = vec4(a2.zw, b2.xy);
  z = mix(vec4(0.0), z, greaterThanEqual(z, vec4(push.min_depth)));
  z = mix(vec4(0.0), z, lessThanEqual(z, vec4(push.max_depth)));
  vec4 sigma = depth_noise(z);
  vec4 jump = push.edge_slope * sigma;
  bvec4 across = between(vec4(a2.yzw, b2.x), z, vec4(a2.w, b2.xyz), jump);
  bvec4 along = between(vec4(a1.zw, b1.xy), z, vec4(a3.zw, b3.xy), jump);
  z = mix(mix(z, vec4(0.0), across), vec4(0.0), along);

  vec4 q = inverse_depth(z), inverse = 1.0 / (push.range * sigma * q * q);
  a0 = inverse_depth(a0), b0 = inverse_depth(b0), a1 = inverse_depth(a1), b1 = inverse_depth(b1);
  a2 = inverse_depth(a2), b2 = inverse_depth(b2), a3 = inverse_depth(a3), b3 = inverse_depth(b3);
  a4 = inverse_depth(a4), b4 = inverse_depth(b4);
  vec3 g = vec3(1.0, exp(push.spatial), exp(4.0 * push.spatial));
  vec4 sum = vec4(0.0), weights = vec4(0.0);
  add_row(a0, b0, q, inverse, g * g.z, sum, weights);
  add_row(a1, b1, q, inverse, g * g.y, sum, weights);
  add_row(a2, b2, q, inverse, g, sum, weights);
  add_row(a3, b3, q, inverse, g * g.y, sum, weights);
  add_row(a4, b4, q, inverse, g * g.z, sum, weights);
  vec4 smoothed = mix(vec4(0.0), 1.0 / (q + sum / max(weights, vec4(1e-6))), greaterThan(z, vec4(0.0)));

  uvec4 bits = floatBitsToUint(z);
  ivec4 at = row + x;
  fusion[at.x] = uvec2(bits.x, fetch(colour, at.x));
  fusion[at.y] = uvec2(bits.y, fetch(colour, at.y));
  fusion[at.z] = uvec2(bits.z, fetch(colour, at.z));
  fusion[at.w] = uvec2(bits.w, fetch(colour, at.w));
  smooth_depth[at.x] = smoothed.x;
  smooth_depth[at.y] = smoothed.y;
  smooth_depth[at.z] = smoothed.z;
  smooth_depth[at.w] = smoothed.w;
}
