// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth and colour images become a pyramid of points with normals. A point image holds, by pixel, (depth bits, packed
// normal); depth 0: no point; normal 0: a point without a normal.
#ifndef CAIRN_SURFACE_H
#define CAIRN_SURFACE_H
#include "shaders/lens.h"
#include "shaders/noise.h"
#include "shaders/shutter.h"
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

struct SurfaceRectifyPush {
  ShutterMotion motion;
  float distance;  // metres, of what has no depth
};

struct SurfaceColourPush {
  ShutterMotion motion;  // of the colour camera
  uint width;            // of depth
  uint height;
};

struct SurfaceBrightnessPush {
  ShutterMotion motion;  // of the colour camera
  uint width;            // of the level
  uint height;
};

struct ColourView {  // a colour camera beside the depth camera; a kernel's constants, see surface_colour.h
  Pinhole camera;           // of colour
  LensBend lens;            // of colour
  Rigid colour_from_depth;  // takes (z * column, z * row, z) of an undistorted depth pixel to the colour camera's frame
  float widest;             // tangent of the angle to the axis up to which `lens` holds
  uint cell;                // pixels a side of what keeps the nearest depth
  uint mean;                // pixels a side of what is averaged for a depth pixel; 1: between four pixels
  uint is_rolling;          // its shutter
};

struct SurfaceFilterPush {
  uint width;
  uint height;
  float min_depth;
  float max_depth;
  float spatial;     // -1 / (2 sigma^2), sigma in pixels
  float range;       // where the weight ends, in standard deviations of the depth noise
  float edge_slope;  // in standard deviations of the depth noise
  uint halves;       // 1: and makes the next level
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
struct SurfacePointsPush {
  Pinhole camera;
  uint has_colour;  // and with it packed pixels
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
// Of colour in levels of 0..255.
float luminance(vec3 rgb) { return dot(rgb, vec3(0.299, 0.587, 0.114)) * (1.0 / 255.0); }
bool is_exposed(vec3 rgb) {
  float most = max(max(rgb.r, rgb.g), rgb.b);
  return most < 253.0 && most > 2.0;
}

// What compares depths compares their inverses, 1 / m: there the noise is as large for what lies nearer as for what lies
// farther. Limits in depth would move surfaces, and with them the whole path, by which side they cut more noise from.
vec4 inverse_depth(vec4 z) { return 1.0 / max(z, vec4(1e-3)); }  // of no measurement: far beside all others

// Of four pixels that become one, those that lie where the first of them does: 1, the others: 0. A sensor may well be
// twice as noisy as depth_noise says; of what is left out then, the mean would miss the noise's other half.
vec4 at_one_place(vec4 z) {
  const float kApart = 12.0;  // standard deviations
  vec4 valid = vec4(greaterThan(z, vec4(0.0))), q = inverse_depth(z);
  float first = valid.x > 0.0 ? q.x : valid.y > 0.0 ? q.y : valid.z > 0.0 ? q.z : q.w;
  return valid * vec4(lessThanEqual(abs(q - first), vec4(kApart * depth_noise(1.0 / first) * first * first)));
}

// The depth of pixels that are at one place; 0: of none.
float mean_depth(vec4 z, vec4 same) {
  float count = dot(same, vec4(1.0));
  return count > 0.0 ? count / dot(inverse_depth(z), same) : 0.0;
}
#endif

#endif
