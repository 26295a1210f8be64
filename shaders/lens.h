// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Lens distortion model, see cairn::Lens.
#ifndef CAIRN_LENS_H
#define CAIRN_LENS_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

struct LensBend {
  float k1;  // in the order of OpenCV; k1 k2 p1 p2 hold k1 k2 k3 k4 of a fisheye
  float k2;
  float p1;
  float p2;
  float k3;
  float k4;
  float k5;
  float k6;
  uint is_fisheye;
};

#ifdef __cplusplus
inline LensBend lens_bend(const Camera& c) {
  const auto k = [&](std::size_t i) { return static_cast<float>(c.distortion[i]); };
  return {k(0), k(1), k(2), k(3), k(4), k(5), k(6), k(7), c.lens == Lens::fisheye ? 1u : 0u};
}
}  // namespace cairn::shader
#else
// Distorts the ray (n, 1); returns the distorted coordinates at z = 1.
vec2 bend(LensBend lens, vec2 n) {
  float r2 = dot(n, n);
  if (lens.is_fisheye != 0u) {
    float r = sqrt(r2), angle = atan(r), a2 = angle * angle;
    float bent = angle * (1.0 + a2 * (lens.k1 + a2 * (lens.k2 + a2 * (lens.p1 + a2 * lens.p2))));
    return n * (r > 0.0 ? bent / r : 1.0);
  }
  float radial = 1.0 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  radial /= 1.0 + r2 * (lens.k4 + r2 * (lens.k5 + r2 * lens.k6));
  return n * radial + vec2(2.0 * lens.p1 * n.x * n.y + lens.p2 * (r2 + 2.0 * n.x * n.x),
                           lens.p1 * (r2 + 2.0 * n.y * n.y) + 2.0 * lens.p2 * n.x * n.y);
}
#endif
#endif
