// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth and colour images become a pyramid of points with normals. A point image holds, by pixel, (depth bits, packed
// normal); depth 0: no point; normal 0: a point without a normal.
#ifndef CAIRN_SURFACE_H
#define CAIRN_SURFACE_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

struct SurfaceRectifyPush {
  Pinhole camera;
  float k1;
  float k2;
  float p1;
  float p2;
  float k3;
  uint has_colour;
};

struct SurfaceFilterPush {
  uint width;
  uint height;
  float min_depth;
  float max_depth;
  float spatial;     // -1 / (2 sigma^2), sigma in pixels
  float range;       // where the weight ends, in standard deviations of the depth noise
  float edge_slope;  // in standard deviations of the depth noise
};

struct SurfaceHalfPush {
  uint width;   // of the coarser image
  uint height;
  uint fine_width;  // of the finer one: twice that, and one more where it is odd
};

struct SurfaceIntensityPush {
  uint width;  // of the result
  uint height;
  uint fine_width;   // of the source
  uint factor;       // source pixels a pixel, along x and y: 1 or 2
  uint from_colour;  // 1: the source is a fusion image; 0: it holds intensities
};

// A packed pixel holds what one bilinear sample needs: x = I(x, y) | I(x + 1, y) << 12 | low byte of the depth << 24,
// y = I(x, y + 1) | I(x + 1, y + 1) << 12 | high byte << 24. Intensities are 1 + 4094 times theirs, 0: none. Depth in mm.
struct SurfacePackPush {
  uint width;
  uint height;
};

struct SurfaceNormalsPush {
  Pinhole camera;
};

#ifdef __cplusplus
/// Standard deviation, in metres, of a structured-light depth measurement (Nguyen, Izadi & Lovell 2012, axial noise).
inline float depth_noise(float z) { return 0.0012f + 0.0019f * (z - 0.4f) * (z - 0.4f); }
}  // namespace cairn::shader
#else
float depth_noise(float z) { return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4); }  // Nguyen, Izadi & Lovell 2012; metres
#endif

#endif
