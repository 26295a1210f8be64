// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Nearest measurement of each block of 2x2 pixels of a depth image, 0 if any of them is missing. At an odd border the
// last pixel is counted twice.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { DepthTilesPush push; };
PAIRS(0, fusion);
layout(binding = 1, scalar) writeonly buffer QuadMinDepth { float quad_min_depth[]; };

float depth_at(int x, int y) {
  return uintBitsToFloat(fetch(fusion, min(y, int(push.height) - 1) * int(push.width) + min(x, int(push.width) - 1)).x);
}

void main() {
  uint columns = (push.width + 1u) >> 1, rows = (push.height + 1u) >> 1, i = thread_index();
  if (i >= columns * rows) return;
  int x = 2 * int(i % columns), y = 2 * int(i / columns);
  quad_min_depth[i] = min(min(depth_at(x, y), depth_at(x + 1, y)), min(depth_at(x, y + 1), depth_at(x + 1, y + 1)));
}
