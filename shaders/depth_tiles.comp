// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The farthest measurement of each tile of a depth image, 0 where it has none.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { DepthTilesPush push; };
layout(binding = 0, scalar) readonly buffer Fusion { uvec2 fusion[]; };
layout(binding = 1, scalar) writeonly buffer Farthest { float farthest[]; };

void main() {
  uint columns = (push.width + kTile - 1u) / kTile, rows = (push.height + kTile - 1u) / kTile;
  uint i = gl_GlobalInvocationID.x;
  if (i >= columns * rows) return;
  uint x0 = (i % columns) * kTile, y0 = (i / columns) * kTile;
  float most = 0.0;
  for (uint y = y0; y < min(y0 + kTile, push.height); ++y)
    for (uint x = x0; x < min(x0 + kTile, push.width); ++x) most = max(most, uintBitsToFloat(fusion[y * push.width + x].x));
  farthest[i] = most;
}
