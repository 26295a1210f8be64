// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Selects the views with the largest weight for a tile. One thread per tile.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TextureBlendPush push; };
layout(binding = 0, scalar) readonly buffer Texels { Texel texels[]; };
WORDS(1, views);
layout(binding = 2, scalar) buffer Chosen { uvec2 chosen[]; };  // kTileViews per tile: weight bits and view

const uint kSamples = 5;

// Texel with a point closest to a sample position of the tile.
uint sample_of(uint tile, uint k) {
  uint place = k == 0u ? 27u : k == 1u ? 9u : k == 2u ? 14u : k == 3u ? 49u : 54u, found = kNoView;
  for (uint i = 0u; i < kTileTexels && found == kNoView; ++i) {
    uint at = tile * kTileTexels + (place + i) % kTileTexels;
    found = texels[at].normal != 0u ? at : kNoView;
  }
  return found;
}

void main() {
  uint tile = thread_index();
  if (tile >= push.tiles) return;
  uint s0 = sample_of(tile, 0u), s1 = sample_of(tile, 1u), s2 = sample_of(tile, 2u), s3 = sample_of(tile, 3u),
       s4 = sample_of(tile, 4u);
  uint first = tile * kTileViews;
  for (uint k = 0u; k < kTileViews; ++k) chosen[first + k] = uvec2(0u, kNoView);
  for (uint v = 0u; v < push.views; ++v) {
    TextureView view = view_at(views, v);
    float weight = 0.0;
    for (uint k = 0u; k < kSamples; ++k) {
      Texel t = texels[k == 0u ? s0 : k == 1u ? s1 : k == 2u ? s2 : k == 3u ? s3 : s4];
      vec2 pixel;
      weight += view_weight(view, push.camera, t.position, unpack_normal(t.normal), push.tolerance, pixel);
    }
    // Insertion sort, which drops the worst view; weights are not negative, so their bits sort like integers.
    uvec2 mine = uvec2(floatBitsToUint(weight), v);
    for (uint k = 0u; k < kTileViews; ++k) {
      uvec2 other = chosen[first + k];
      bool better = mine.x > other.x;
      chosen[first + k] = better ? mine : other;
      mine = better ? other : mine;
    }
  }
}
