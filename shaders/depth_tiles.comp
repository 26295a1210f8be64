// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Farthest measurement of each tile of a depth image, 0 if the tile is empty, and nearest measurement, 0 if any is
// missing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { DepthTilesPush push; };
PAIRS(0, fusion);
layout(binding = 1, scalar) writeonly buffer Farthest { float farthest[]; };
layout(binding = 2, scalar) writeonly buffer Nearest { float nearest[]; };

void main() {
  uint columns = tiles_along(push.width), rows = tiles_along(push.height);
  uint i = thread_index();
  if (i >= columns * rows) return;
  int x0 = int((i % columns) * kTile), last = int(push.width) - 1;
  uint y0 = (i / columns) * kTile;
  float max_depth = 0.0, min_depth = 1e9;
  for (uint y = y0; y < min(y0 + kTile, push.height); ++y)
    for (int k = 0; k < int(kTile); ++k) {  // fixed length, for unrolling; border tiles repeat the last pixel
      float z = uintBitsToFloat(fetch(fusion, int(y * push.width) + min(x0 + k, last)).x);
      max_depth = max(max_depth, z);
      min_depth = min(min_depth, z);
    }
  farthest[i] = max_depth;
  nearest[i] = min_depth;
}
