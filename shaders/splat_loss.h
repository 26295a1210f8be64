// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Loss of a rendered image: L1 and D-SSIM (Wang et al. 2004, 11 x 11 window of sigma 1.5, zero beyond the image), depth
// and opacity.
#ifndef CAIRN_SPLAT_LOSS_H
#define CAIRN_SPLAT_LOSS_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kLossMoments = 5;  // planes per channel: means of x, y, x^2, y^2 and x y
const uint kLossMaps = 3;     // planes per channel: derivatives of SSIM by the means of x, x^2 and x y
const uint kLossSums = 8;     // per row: loss, squared error, gradients of gain and offset

struct SplatLossPush {
  uint width, height;
  vec3 gain, offset;  // exposure of the image: its colors are compared as gain * color + offset
  float structure;    // weight of D-SSIM; the rest is L1
  float depth;        // weight of depth, per meter
  float opacity;      // weight of missing opacity in front of a surface
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
// Calls TAP(k, weights) for the pixels k - 5 from the first of four neighbors, with their weights in the windows of the
// four: a thread loads a pixel once for four windows.
#define TAPS \
  TAP(0, vec4(0.00102838, 0.0, 0.0, 0.0)) \
  TAP(1, vec4(0.00759876, 0.00102838, 0.0, 0.0)) \
  TAP(2, vec4(0.03600077, 0.00759876, 0.00102838, 0.0)) \
  TAP(3, vec4(0.10936069, 0.03600077, 0.00759876, 0.00102838)) \
  TAP(4, vec4(0.21300554, 0.10936069, 0.03600077, 0.00759876)) \
  TAP(5, vec4(0.26601172, 0.21300554, 0.10936069, 0.03600077)) \
  TAP(6, vec4(0.21300554, 0.26601172, 0.21300554, 0.10936069)) \
  TAP(7, vec4(0.10936069, 0.21300554, 0.26601172, 0.21300554)) \
  TAP(8, vec4(0.03600077, 0.10936069, 0.21300554, 0.26601172)) \
  TAP(9, vec4(0.00759876, 0.03600077, 0.10936069, 0.21300554)) \
  TAP(10, vec4(0.00102838, 0.00759876, 0.03600077, 0.10936069)) \
  TAP(11, vec4(0.0, 0.00102838, 0.00759876, 0.03600077)) \
  TAP(12, vec4(0.0, 0.0, 0.00102838, 0.00759876)) \
  TAP(13, vec4(0.0, 0.0, 0.0, 0.00102838))
float channel_of(uint word, uint channel) { return float(word >> (8u * channel) & 255u) / 255.0; }
#endif
#endif
