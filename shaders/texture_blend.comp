// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color of each texel from its tile's views, in two bands (Burt & Adelson 1983): low frequencies are a mean of all
// views, to hide seams; high frequencies come almost only from the best view, to avoid ghosting by slightly misaligned
// views. Views with a color far from the mean see another surface and are excluded.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TextureBlendPush push; };
layout(binding = 0, scalar) readonly buffer Texels { Texel texels[]; };
WORDS(1, views);
PAIRS(2, chosen);
layout(binding = 3, scalar) writeonly buffer Colors { uint colors[]; };  // alpha 0: visible in no view

const float kDiffers = 0.1;  // color difference, in 0..1, at which the confidence is a quarter

void main() {
  uint i = thread_index(), tile = i / kTileTexels;
  if (tile >= push.tiles) return;
  Texel texel = texels[i];
  vec3 normal = unpack_normal(texel.normal), mean = vec3(0.0);
  float total = 0.0, best = 0.0;
  vec4 seen[kTileViews];  // smooth color and weight by view
  vec2 pixels[kTileViews];
  uint count = 0u;
  for (; count < kTileViews; ++count) {
    uint v = fetch(chosen, int(tile * kTileViews + count)).y;
    if (v == kNoView) break;
    TextureView view = view_at(views, v);
    vec2 pixel;
    float w = view_weight(view, push.camera, texel.position, normal, push.tolerance, pixel);
    vec3 smooth_c = smooth_color(view, push.camera, pixel);
    seen[count] = vec4(smooth_c, w);
    pixels[count] = pixel;
    mean += w * smooth_c;
    total += w;
    best = max(best, w);
  }
  if (texel.normal == 0u || total == 0.0) {
    colors[i] = texel.color & 0xffffffu;
    return;
  }
  mean /= total;
  vec3 low = vec3(0.0), high = vec3(0.0);
  float low_total = 0.0, high_total = 0.0;
  for (uint k = 0u; k < count; ++k) {
    float w = seen[k].w;
    vec3 smooth_c = seen[k].rgb, d = (smooth_c - mean) / kDiffers;
    float confidence = 1.0 / (1.0 + dot(d, d));
    confidence *= confidence;
    float share = w / best, share2 = share * share, sharp = share2 * share2 * share2 * confidence;
    low += w * confidence * smooth_c;
    low_total += w * confidence;
    uint v = fetch(chosen, int(tile * kTileViews + k)).y;
    high += sharp * (sharp_color(pixels_at(views, v), push.camera, pixels[k]) - smooth_c);
    high_total += sharp;
  }
  colors[i] = packUnorm4x8(vec4(low / low_total + high / max(high_total, 1e-12), 1.0));
}
