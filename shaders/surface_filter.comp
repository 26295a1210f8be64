// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Removes measurements out of range and flying pixels, and smooths the rest without crossing edges (Tomasi & Manduchi
// 1998, with Tukey's biweight instead of the Gaussian in depth: no exponential, and zero across edges). Then halves the
// image: the mean of the pixels of a 2x2 block on the same surface. `fusion` holds (depth bits, color) unsmoothed,
// because fusion averages anyway; the smoothed depth is for normals and alignment. A thread processes four pixels of
// two rows, which share most of their reads.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SurfaceFilterPush push; };
layout(constant_id = 4) const float kFusesColor = 1.0;  // color is registered to depth
layout(constant_id = 5) const float kKeepsFinest = 0.0;  // also writes the smoothed full-resolution depth
FLOATS(0, depth);
WORDS(1, color);
layout(binding = 2, scalar) writeonly buffer Fusion { uvec2 fusion[]; };
layout(binding = 3, scalar) writeonly buffer Smooth { float smooth_depth[]; };
layout(binding = 4, scalar) writeonly buffer Half { float half_depth[]; };

int width, height;
ivec4 x;  // columns of the four pixels

struct Row {  // eight pixels, starting two before the four
  vec4 a, b;
};

vec4 depth_clamped(ivec4 columns, int row) {
  ivec4 at = row + clamp(columns, ivec4(0), ivec4(width - 1));
  return vec4(fetch(depth, at.x), fetch(depth, at.y), fetch(depth, at.z), fetch(depth, at.w));
}
Row row_at(int y) {
  int row = clamp(y, 0, height - 1) * width;
  return Row(depth_clamped(x - 2, row), depth_clamped(x + 2, row));
}
Row inverse_of(Row r) { return Row(inverse_depth(r.a), inverse_depth(r.b)); }
vec4 middle_of(Row r) { return vec4(r.a.zw, r.b.xy); }

// Weighted differences of inverse depth to the centers, summed over a row of five neighbors; g holds the spatial
// weights at distances 0, 1 and 2.
void add_row(Row r, vec4 q, vec4 inverse, vec3 g, inout vec4 sum, inout vec4 weights) {
  vec4 d0 = r.a - q, d1 = vec4(r.a.yzw, r.b.x) - q, d2 = middle_of(r) - q, d3 = vec4(r.a.w, r.b.xyz) - q, d4 = r.b - q;
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

// Flying pixels: a pixel between a nearer and a farther neighbor is not on a surface; the sensor mixed both.
bvec4 between(vec4 a, vec4 z, vec4 b, vec4 jump) {
  vec4 da = a - z, db = b - z;
  vec4 crossed = step(da * db, vec4(-1e-12)) * step(vec4(1e-6), min(a, b)) * step(jump, min(abs(da), abs(db)));
  return greaterThan(crossed, vec4(0.5));
}

// Valid depth of the four pixels, and its standard deviation.
vec4 cleaned(Row above, Row here, Row below, out vec4 sigma) {
  vec4 z = middle_of(here);
  z = mix(vec4(0.0), z, greaterThanEqual(z, vec4(push.min_depth)));
  z = mix(vec4(0.0), z, lessThanEqual(z, vec4(push.max_depth)));
  sigma = depth_noise(z);
  vec4 jump = push.edge_slope * sigma;
  bvec4 across = between(vec4(here.a.yzw, here.b.x), z, vec4(here.a.w, here.b.xyz), jump);
  bvec4 along = between(middle_of(above), z, middle_of(below), jump);
  return mix(mix(z, vec4(0.0), across), vec4(0.0), along);
}

// Smoothed depth from five rows of inverse depths.
vec4 smoothed(Row r0, Row r1, Row r2, Row r3, Row r4, vec4 z, vec4 sigma, vec3 g) {
  vec4 q = inverse_depth(z), inverse = 1.0 / (push.range * sigma * q * q);
  vec4 sum = vec4(0.0), weights = vec4(0.0);
  add_row(r0, q, inverse, g * g.z, sum, weights);
  add_row(r1, q, inverse, g * g.y, sum, weights);
  add_row(r2, q, inverse, g, sum, weights);
  add_row(r3, q, inverse, g * g.y, sum, weights);
  add_row(r4, q, inverse, g * g.z, sum, weights);
  return mix(vec4(0.0), 1.0 / (q + sum / max(weights, vec4(1e-6))), greaterThan(z, vec4(0.0)));
}

void keep(int y, vec4 z, vec4 smooth_z) {
  uvec4 bits = floatBitsToUint(z), rgb = uvec4(0u);
  ivec4 at = y * width + x;
  if (kFusesColor > 0.0) rgb = uvec4(fetch(color, at.x), fetch(color, at.y), fetch(color, at.z), fetch(color, at.w));
  fusion[at.x] = uvec2(bits.x, rgb.x);
  fusion[at.y] = uvec2(bits.y, rgb.y);
  fusion[at.z] = uvec2(bits.z, rgb.z);
  fusion[at.w] = uvec2(bits.w, rgb.w);
  if (kKeepsFinest > 0.0) {
    smooth_depth[at.x] = smooth_z.x;
    smooth_depth[at.y] = smooth_z.y;
    smooth_depth[at.z] = smooth_z.z;
    smooth_depth[at.w] = smooth_z.w;
  }
}

void main() {
  width = int(push.width);
  height = int(push.height);
  ivec2 place = thread_place();
  int y = 2 * place.y, first = 4 * place.x;
  // If the width is not a multiple of four, the last four pixels of a row overlap the preceding four. For an odd width,
  // an extra thread processes four pixels that start at an odd column; these are not halved.
  if (first >= width + 4 * (width & 1) || y >= height) return;
  if (first + 4 > width) first = first >= width ? width - 4 : (width - 4) & ~1;
  x = first + ivec4(0, 1, 2, 3);

  Row m0 = row_at(y - 2), m1 = row_at(y - 1), m2 = row_at(y), m3 = row_at(y + 1), m4 = row_at(y + 2), m5 = row_at(y + 3);
  vec4 sigma_above, sigma_below;
  vec4 above = cleaned(m1, m2, m3, sigma_above), below = cleaned(m2, m3, m4, sigma_below);
  bool is_pair = y + 1 < height;
  if (push.smooths == 0u) {
    keep(y, above, above);
    if (is_pair) keep(y + 1, below, below);
    return;
  }
  m0 = inverse_of(m0), m1 = inverse_of(m1), m2 = inverse_of(m2), m3 = inverse_of(m3), m4 = inverse_of(m4);
  m5 = inverse_of(m5);
  vec3 g = vec3(1.0, exp(push.spatial), exp(4.0 * push.spatial));
  vec4 smooth_above = smoothed(m0, m1, m2, m3, m4, above, sigma_above, g);
  vec4 smooth_below = smoothed(m1, m2, m3, m4, m5, below, sigma_below, g);
  keep(y, above, smooth_above);
  if (is_pair) keep(y + 1, below, smooth_below);
  if (push.halves == 0u || !is_pair || (first & 1) != 0) return;
  vec4 left = vec4(smooth_above.xy, smooth_below.xy), right = vec4(smooth_above.zw, smooth_below.zw);
  int half_at = place.y * (width >> 1) + (first >> 1);
  half_depth[half_at] = mean_depth(left, on_same_surface(left));
  half_depth[half_at + 1] = mean_depth(right, on_same_surface(right));
}
