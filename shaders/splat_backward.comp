// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gradients of a tile's splats from the gradients of its pixels, front to back: with q = dL/dpixel . splat, the splats
// behind contribute the pixel's total of weight * q minus its sum so far.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatImagePush push; };
PAIRS(0, projected);
layout(binding = 1, scalar) readonly buffer Splats { uint splats[]; };
layout(binding = 2, scalar) readonly buffer Slots { uint slots[]; };
layout(binding = 3, scalar) readonly buffer Ranges { uint ranges[]; };
layout(binding = 4, scalar) readonly buffer Image { float image[]; };
layout(binding = 5, scalar) readonly buffer PixelGradients { float pixel_gradients[]; };
layout(binding = 6, scalar) writeonly buffer SlotShapes { float slot_shapes[]; };  // kSplatSlot per slot
layout(binding = 7, scalar) writeonly buffer SlotColors { float slot_colors[]; };

struct Row {
  vec4 transmittance, live, behind;
  vec4 red, green, blue, opacity, depth;  // gradients of the pixels
};
struct Sum {
  vec4 power, power_y, power_yy;  // of the gradient by the exponent: by column, times dy, times dy^2
  vec4 red, green, blue, depth;
};

vec4 four(uint plane, uint x, uint y, bool of_image) {
  uint at = plane * push.width * push.height + min(y, push.height - 1u) * push.width;
  uvec4 column = min(uvec4(x, x + 1u, x + 2u, x + 3u), uvec4(push.width - 1u)) + at;
  if (of_image) return vec4(image[column.x], image[column.y], image[column.z], image[column.w]);
  return vec4(pixel_gradients[column.x], pixel_gradients[column.y], pixel_gradients[column.z], pixel_gradients[column.w]);
}

Row row_at(uint x, uint y) {
  Row row;
  row.transmittance = vec4(1.0);
  row.live = y < push.height ? vec4(lessThan(uvec4(x, x + 1u, x + 2u, x + 3u), uvec4(push.width))) : vec4(0.0);
  row.red = four(0u, x, y, false);
  row.green = four(1u, x, y, false);
  row.blue = four(2u, x, y, false);
  row.opacity = four(3u, x, y, false);
  row.depth = four(4u, x, y, false);
  row.behind = row.red * four(0u, x, y, true) + row.green * four(1u, x, y, true) + row.blue * four(2u, x, y, true) +
               row.opacity * four(3u, x, y, true) + row.depth * four(4u, x, y, true);
  return row;
}

void add(inout Row row, inout Sum sum, ProjectedSplat s, vec4 dx, float dy) {
  vec4 alpha = alpha_of(s, dx, dy, row.transmittance, row.live), weight = row.transmittance * alpha;
  vec4 q = row.red * s.red + row.green * s.green + row.blue * s.blue + row.opacity + row.depth * s.depth;
  row.behind -= weight * q;
  vec4 of_power = weight * q - alpha * row.behind / (1.0 - alpha);
  of_power = mix(vec4(0.0), of_power, lessThan(alpha, vec4(kMaxSplatAlpha)));
  row.transmittance *= 1.0 - alpha;
  sum.power += of_power;
  sum.power_y += of_power * dy;
  sum.power_yy += of_power * (dy * dy);
  sum.red += weight * row.red;
  sum.green += weight * row.green;
  sum.blue += weight * row.blue;
  sum.depth += weight * row.depth;
}

float total(vec4 v) { return dot(v, vec4(1.0)); }

void main() {
  uint tile = thread_index();
  if (tile >= push.tiles) return;
  uint x = tile % push.columns * kSplatTile, y = tile / push.columns * kSplatTile;
  vec4 u = float(x) + vec4(0.0, 1.0, 2.0, 3.0);
  float v = float(y);
  Row r0 = row_at(x, y), r1 = row_at(x, y + 1u), r2 = row_at(x, y + 2u), r3 = row_at(x, y + 3u);
  uint end = ranges[2u * tile + 1u];
  for (uint i = ranges[2u * tile]; i < end; ++i) {
    ProjectedSplat s;
    int splat = int(splats[i]);
    SPLAT_TEXELS(projected, splat, s)
    vec4 dx = s.u - u;
    float dy = s.v - v;
    Sum sum = Sum(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    add(r0, sum, s, dx, dy);
    add(r1, sum, s, dx, dy - 1.0);
    add(r2, sum, s, dx, dy - 2.0);
    add(r3, sum, s, dx, dy - 3.0);
    uint at = slots[i] * kSplatSlot;
    float x_moment = dot(sum.power, dx), y_moment = total(sum.power_y);
    slot_shapes[at] = -(s.a * x_moment + s.b * y_moment);
    slot_shapes[at + 1u] = -(s.b * x_moment + s.c * y_moment);
    slot_shapes[at + 2u] = -0.5 * dot(sum.power, dx * dx);
    slot_shapes[at + 3u] = -dot(sum.power_y, dx);
    slot_shapes[at + 4u] = -0.5 * total(sum.power_yy);
    slot_colors[at] = total(sum.power) / s.opacity;
    slot_colors[at + 1u] = total(sum.red);
    slot_colors[at + 2u] = total(sum.green);
    slot_colors[at + 3u] = total(sum.blue);
    slot_colors[at + 4u] = total(sum.depth);
  }
}
