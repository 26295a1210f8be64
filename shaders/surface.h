// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Pyramid of points with normals from depth and color images. A point image stores, per pixel, (depth bits, packed
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
  float distance;  // meters; assumed for pixels without depth
};

struct SurfaceColorPush {
  ShutterMotion motion;  // motion of the color camera
  uint width;            // size of the depth image
  uint height;
};

struct SurfaceBrightnessPush {
  ShutterMotion motion;  // motion of the color camera
  uint width;            // size of the level
  uint height;
};

struct ColorView {  // a color camera next to the depth camera; specialization constants of kernels, see
                     // surface_color.h
  Pinhole camera;           // color camera
  LensBend lens;            // color camera
  Rigid color_from_depth;  // maps (z * column, z * row, z) of an undistorted depth pixel to the color camera frame
  float widest;             // tangent of the largest angle to the axis at which `lens` is valid
  uint cell;                // side of the nearest-depth cells, pixels
  uint mean;                // side of the averaging window per depth pixel, pixels; 1: bilinear
  uint is_rolling;          // rolling shutter
};

struct SurfaceFilterPush {
  uint width;
  uint height;
  float min_depth;
  float max_depth;
  float spatial;     // -1 / (2 sigma^2), sigma in pixels
  float range;       // residual at which the weight reaches 0, in standard deviations of the depth noise
  float edge_slope;  // in standard deviations of the depth noise
  uint smooths;      // 0: only writes the fusion image
  uint halves;       // 1: also computes the next level
};

struct SurfaceHalfPush {
  uint width;   // size of the coarser image
  uint height;
  uint fine_width;  // width of the finer image: twice `width`, plus 1 if odd
};

struct SurfaceIntensityPush {
  uint width;  // size of the result
  uint height;
  uint fine_width;   // width of the source
  uint factor;       // source pixels per pixel, along x and y: 1 or 2
  uint from_color;  // 1: the source is a fusion image; 0: intensities
};

// A packed pixel holds the data for one bilinear sample: x = I(x, y) | I(x + 1, y) << 12 | low byte of the depth << 24,
// y = I(x, y + 1) | I(x + 1, y + 1) << 12 | high byte << 24. Intensities are stored as 1 + 4094 * intensity, 0: none.
// Depth in mm.
struct SurfacePointsPush {
  Pinhole camera;
  uint has_color;  // 1: also writes packed pixels
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
// Luminance in 0..1 of a color in levels of 0..255.
float luminance(vec3 rgb) { return dot(rgb, vec3(0.299, 0.587, 0.114)) * (1.0 / 255.0); }
bool is_exposed(vec3 rgb) {
  float max_channel = max(max(rgb.r, rgb.g), rgb.b);
  return max_channel < 253.0 && max_channel > 2.0;
}

// Depths are compared as inverse depths, 1 / m, in which the noise is symmetric between nearer and farther values.
// Limits in depth would cut more noise on one side and thereby bias surfaces and the trajectory.
vec4 inverse_depth(vec4 z) { return 1.0 / max(z, vec4(1e-3)); }  // a missing measurement is far from all others

// For four pixels to merge: 1 for those on the same surface as the first valid pixel, else 0. The limit is generous,
// since a sensor may be twice as noisy as depth_noise: excluding outliers on one side only would bias the mean.
vec4 on_same_surface(vec4 z) {
  const float kMaxDeviation = 12.0;  // standard deviations
  vec4 valid = vec4(greaterThan(z, vec4(0.0))), q = inverse_depth(z);
  float first = valid.x > 0.0 ? q.x : valid.y > 0.0 ? q.y : valid.z > 0.0 ? q.z : q.w;
  return valid * vec4(lessThanEqual(abs(q - first), vec4(kMaxDeviation * depth_noise(1.0 / first) * first * first)));
}

// Mean depth of the pixels on the same surface; 0 if there are none.
float mean_depth(vec4 z, vec4 same) {
  float count = dot(same, vec4(1.0));
  return count > 0.0 ? count / dot(inverse_depth(z), same) : 0.0;
}
#endif

#endif
