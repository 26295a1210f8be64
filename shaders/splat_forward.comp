// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color, opacity and depth of the pixels of a tile, front to back.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatImagePush push; };
PAIRS(0, projected);
layout(binding = 1, scalar) readonly buffer Splats { uint splats[]; };
layout(binding = 2, scalar) buffer Ranges { uint ranges[]; };  // the end is moved to the last splat with an effect
layout(binding = 3, scalar) writeonly buffer Image { float image[]; };

struct Row {
  vec4 transmittance, live, red, green, blue, depth;
};

void blend(inout Row row, ProjectedSplat s, vec4 dx, float dy) {
  vec4 alpha = alpha_of(s, dx, dy, row.transmittance, row.live), weight = row.transmittance * alpha;
  row.red += weight * s.red;
  row.green += weight * s.green;
  row.blue += weight * s.blue;
  row.depth += weight * s.depth;
  row.transmittance *= 1.0 - alpha;
}

void store(Row row, uint x, uint y) {
  if (y >= push.height) return;
  uint pixels = push.width * push.height;
  for (uint k = 0u; k < kSplatTile; ++k) {
    if (x + k >= push.width) break;
    uint at = y * push.width + x + k;
    image[at] = row.red[k];
    image[pixels + at] = row.green[k];
    image[2u * pixels + at] = row.blue[k];
    image[3u * pixels + at] = 1.0 - row.transmittance[k];
    image[4u * pixels + at] = row.depth[k];
  }
}

void main() {
  uint tile = thread_index();
  if (tile >= push.tiles) return;
  uint x = tile % push.columns * kSplatTile, y = tile / push.columns * kSplatTile;
  vec4 u = float(x) + vec4(0.0, 1.0, 2.0, 3.0);
  float v = float(y);
  Row none = Row(vec4(1.0), vec4(1.0), vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
  Row r0 = none, r1 = none, r2 = none, r3 = none;
  uint i = ranges[2u * tile], end = ranges[2u * tile + 1u];
  for (; i < end; ++i) {
    vec4 live = r0.live + r1.live + r2.live + r3.live;
    if (dot(live, vec4(1.0)) == 0.0) break;
    ProjectedSplat s;
    int at = int(splats[i]);
    SPLAT_TEXELS(projected, at, s)
    vec4 dx = s.u - u;
    float dy = s.v - v;
    blend(r0, s, dx, dy);
    blend(r1, s, dx, dy - 1.0);
    blend(r2, s, dx, dy - 2.0);
    blend(r3, s, dx, dy - 3.0);
  }
  ranges[2u * tile + 1u] = i;
  store(r0, x, y);
  store(r1, x, y + 1u);
  store(r2, x, y + 2u);
  store(r3, x, y + 3u);
}
