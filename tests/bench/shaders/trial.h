// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Alternative distance transforms, for comparison with shaders/esdf*, over a dense box. A voxel contains its nearest
// site as x | y << 10 | z << 20, or kNone; x is fastest.
#ifndef CAIRN_TRIAL_H
#define CAIRN_TRIAL_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kNone = 0xffffffffu;

struct SeparablePush {
  ivec3 size;  // voxels
  uint axis;   // direction of the scan lines
  uint lines;
};

struct FloodPush {
  ivec3 size;
  int reach;  // voxels
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
ivec3 site_at(uint s) { return ivec3(s & 1023u, (s >> 10) & 1023u, s >> 20); }
float squared(ivec3 a, ivec3 b) {
  vec3 d = vec3(a - b);
  return dot(d, d);
}
#endif
#endif
