// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Projection of a depth pixel into the color camera. The camera is fixed for the lifetime of a kernel, so its
// parameters are specialization constants: a CPU device reads push constants separately for each lane.
#ifndef CAIRN_SURFACE_COLOR_H
#define CAIRN_SURFACE_COLOR_H
#include "shaders/surface.h"
#ifdef __cplusplus
#include <bit>
#include <cstring>

namespace cairn::shader {

/// Specialization constants of the kernels: the sensor model, then the words of the view, and the factor.
inline std::vector<float> constants_of(const SensorModel& sensor, const ColorView& view, uint factor) {
  const auto first = constants_of(sensor);
  std::vector<float> all(first.size() + sizeof(view) / sizeof(float));
  std::copy(first.begin(), first.end(), all.begin());
  std::memcpy(all.data() + first.size(), &view, sizeof(view));
  all.push_back(std::bit_cast<float>(factor));
  return all;
}

}  // namespace cairn::shader
#else
layout(constant_id = 4) const uint kWidth = 640;
layout(constant_id = 5) const uint kHeight = 480;
layout(constant_id = 6) const float kFx = 525.0;
layout(constant_id = 7) const float kFy = 525.0;
layout(constant_id = 8) const float kCx = 319.5;
layout(constant_id = 9) const float kCy = 239.5;
layout(constant_id = 10) const float kK1 = 0.0;
layout(constant_id = 11) const float kK2 = 0.0;
layout(constant_id = 12) const float kP1 = 0.0;
layout(constant_id = 13) const float kP2 = 0.0;
layout(constant_id = 14) const float kK3 = 0.0;
layout(constant_id = 15) const float kK4 = 0.0;
layout(constant_id = 16) const float kK5 = 0.0;
layout(constant_id = 17) const float kK6 = 0.0;
layout(constant_id = 18) const uint kIsFisheye = 0;
layout(constant_id = 19) const float kXx = 1.0;
layout(constant_id = 20) const float kXy = 0.0;
layout(constant_id = 21) const float kXz = 0.0;
layout(constant_id = 22) const float kYx = 0.0;
layout(constant_id = 23) const float kYy = 1.0;
layout(constant_id = 24) const float kYz = 0.0;
layout(constant_id = 25) const float kZx = 0.0;
layout(constant_id = 26) const float kZy = 0.0;
layout(constant_id = 27) const float kZz = 1.0;
layout(constant_id = 28) const float kTx = 0.0;
layout(constant_id = 29) const float kTy = 0.0;
layout(constant_id = 30) const float kTz = 0.0;
layout(constant_id = 31) const float kWidest = 1.0;
layout(constant_id = 32) const uint kCell = 2;
layout(constant_id = 33) const uint kMean = 1;
layout(constant_id = 34) const uint kIsRolling = 0;
layout(constant_id = 35) const uint kFactor = 2;  // for surface_brightness: depth pixels per pixel, along a side

ColorView view() {
  return ColorView(Pinhole(kWidth, kHeight, kFx, kFy, kCx, kCy),
                    LensBend(kK1, kK2, kP1, kP2, kK3, kK4, kK5, kK6, kIsFisheye),
                    Rigid(vec3(kXx, kXy, kXz), vec3(kYx, kYy, kYz), vec3(kZx, kZy, kZz), vec3(kTx, kTy, kTz)), kWidest, kCell,
                    kMean, kIsRolling);
}

// Most cameras come undistorted; with constants, the compiler removes the distortion.
vec2 bend_of_view(vec2 n) {
  bool is_straight = kIsFisheye == 0u && kK1 == 0.0 && kK2 == 0.0 && kP1 == 0.0 && kP2 == 0.0 && kK3 == 0.0 && kK4 == 0.0 &&
                     kK5 == 0.0 && kK6 == 0.0;
  return is_straight ? n : bend(view().lens, n);
}

vec2 pixel_of_view(vec2 n) {
  return bend_of_view(n) * vec2(view().camera.fx, view().camera.fy) + vec2(view().camera.cx, view().camera.cy);
}

// Projects a depth pixel into the color image; false if outside. `z`: depth, on return in the color camera frame.
bool seen_at(ShutterMotion motion, vec2 depth_pixel, inout float z, out vec2 pixel) {
  vec3 p = transform(view().color_from_depth, z * vec3(depth_pixel, 1.0));
  z = p.z;
  vec2 n = p.xy / max(p.z, 1e-3);
  pixel = pixel_of_view(n);
  if (view().is_rolling != 0u) {  // the row gives the time, which moves the row by a few pixels; a second iteration
                                  // would change it by hundredths
    vec3 then = at_row(motion, p, (pixel.y + 0.5) / float(view().camera.height));
    n = then.xy / max(then.z, 1e-3);
    pixel = pixel_of_view(n);
  }
  return p.z > 1e-3 && dot(n, n) < view().widest * view().widest && min(pixel.x, pixel.y) >= 0.0 &&
         pixel.x <= float(view().camera.width - 1u) && pixel.y <= float(view().camera.height - 1u);
}

// Number of cells in the color image, as computed by nearest_bytes of preprocess.cpp; in float, since a CPU device does
// not vectorize integer division.
ivec2 cells() { return ivec2((vec2(view().camera.width, view().camera.height) - 0.5) / float(view().cell)) + 1; }

const float kUnknownDepth = 2.0;  // meters, assumed for missing depth: not integrated, but avoids artificial edges
const float kHidden = 0.03;       // meters in addition to the noise, minimum depth difference of an occluder

// True if a surface nearer than z occludes the pixel of the color camera. Tests the four surrounding cells.
bool is_hidden(textureBuffer nearest, vec2 pixel, float z) {
  ivec2 count = cells(), cell = ivec2(floor((pixel + 0.5) / float(view().cell) - 0.5));
  ivec2 first = clamp(cell, ivec2(0), count - 1), last = clamp(cell + 1, ivec2(0), count - 1);
  float nearer = min(min(fetch(nearest, first.y * count.x + first.x), fetch(nearest, first.y * count.x + last.x)),
                     min(fetch(nearest, last.y * count.x + first.x), fetch(nearest, last.y * count.x + last.x)));
  return nearer < z - (kHidden + 4.0 * depth_noise(z));
}

// Integer levels: unpackUnorm4x8 would divide each by 255.
vec3 levels_of(uint rgba) { return vec3(ivec3(rgba & 0xffu, (rgba >> 8) & 0xffu, (rgba >> 16) & 0xffu)); }
#endif
#endif
