// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// 3D Gaussian splatting (Kerbl, Kopanas, Leimkühler & Drettakis 2023), with the projection of Zwicker et al. 2001. A
// model is stored in planes: value k of splat i at k * stride + i. A tile of 4 x 4 pixels is the work of one thread: a
// CPU device loads the parameters of a splat once for 16 pixels, and the sum of gradients over a tile has a fixed order
// without atomics.
#ifndef CAIRN_SPLATS_H
#define CAIRN_SPLATS_H
#include "shaders/types.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kSplatTile = 4;  // pixels per side
// Planes of a model and of its gradients.
const uint kSplatPosition = 0, kSplatScale = 3, kSplatRotation = 6, kSplatOpacity = 10, kSplatColor = 11;
const uint kSplatPlanes = 14;     // without harmonics of degree 1 and above, which are planes of a second buffer
const uint kSplatImages = 5;      // planes of an image: color, opacity, depth
const uint kSplatSlot = 5;        // gradients of a splat in a tile: pixel and conic; opacity, color and depth
const uint kNoSplatKey = 0xffffffu;  // depth key of a splat outside the image
const uint kNoSplatRank = 0xffffffffu;
const float kSplatNear = 0.05f;      // meters
const float kMinSplatAlpha = 1.0f / 255.0f, kMaxSplatAlpha = 0.99f;
const float kMinTransmittance = 1e-4f;

struct ProjectedSplat {
  float u, v;     // pixels
  float a, b, c;  // inverse of the 2D covariance, pixels^-2
  float opacity;
  float red, green, blue;
  float depth;  // meters along z
};

struct SplatViewPush {
  Pinhole camera;
  Rigid camera_from_world;
  uint count;      // splats; the stride of the planes of the model
  uint visible;    // splats of the view
  uint degree;     // of the harmonics
  float low_pass;  // pixels^2, added to the 2D covariance
  uint entries;    // of all tiles
};
struct SplatListPush {
  uint count;
  uint columns;  // tiles per row
};
struct SplatImagePush {
  uint width, height;   // pixels
  uint columns, tiles;  // tiles per row, and in total
};
struct SplatAdamPush {
  uint count;    // splats; the stride of the planes
  uint visible;  // splats of the view
  float position, scale, rotation, opacity, color;  // step sizes by plane, see kSplatPosition
  float correction1;                                // 1 - beta1^t
  float correction2;                                // 1 - beta2^t
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
// Pixels covered by a splat down to kMinSplatAlpha, as the first and last tile in both directions; empty: first > last.
ivec4 tiles_of(vec2 at, float a, float c, float opacity, uint width, uint height) {
  float cut = 2.0 * log(max(opacity, kMinSplatAlpha) / kMinSplatAlpha);
  vec2 reach = sqrt(cut * vec2(a, c)) + 0.01;
  vec2 last = vec2(float(width) - 1.0, float(height) - 1.0);
  vec2 from = max(ceil(at - reach), vec2(0.0)), to = min(floor(at + reach), last);
  if (from.x > to.x || from.y > to.y || opacity < kMinSplatAlpha) return ivec4(1, 1, 0, 0);
  return ivec4(ivec2(from), ivec2(to)) / int(kSplatTile);
}

mat3 rotation_of(vec4 q) {  // w, x, y, z; unit length
  return mat3(1.0 - 2.0 * (q.z * q.z + q.w * q.w), 2.0 * (q.y * q.z + q.x * q.w), 2.0 * (q.y * q.w - q.x * q.z),
              2.0 * (q.y * q.z - q.x * q.w), 1.0 - 2.0 * (q.y * q.y + q.w * q.w), 2.0 * (q.z * q.w + q.x * q.y),
              2.0 * (q.y * q.w + q.x * q.z), 2.0 * (q.z * q.w - q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
}

// Slope of the point's ray, clamped beyond the image, where the linearization of the projection breaks down.
vec2 clamped_slope(Pinhole camera, vec3 p) {
  vec2 limit = 0.65 * vec2(camera.width, camera.height) / vec2(camera.fx, camera.fy);
  return clamp(p.xy / p.z, -limit, limit);
}

// Rows of the 2D covariance's factor, V = N N^T: J W R S (Zwicker et al. 2001, eq. 31). `turn`: W R.
void factor_of(Pinhole camera, vec2 slope, float z, mat3 turn, out vec3 u0, out vec3 u1) {
  vec3 x = vec3(turn[0].x, turn[1].x, turn[2].x), y = vec3(turn[0].y, turn[1].y, turn[2].y),
       depth = vec3(turn[0].z, turn[1].z, turn[2].z);
  u0 = camera.fx / z * (x - slope.x * depth);
  u1 = camera.fy / z * (y - slope.y * depth);
}

// Real spherical harmonics of degree 1 to 3 at a unit direction, and their derivatives, as calls of
// HARMONIC(index, value, derivative).
#define HARMONICS_1(d)                                \
  HARMONIC(0u, -0.4886025119 * d.y, vec3(0.0, -0.4886025119, 0.0)) \
  HARMONIC(1u, 0.4886025119 * d.z, vec3(0.0, 0.0, 0.4886025119))   \
  HARMONIC(2u, -0.4886025119 * d.x, vec3(-0.4886025119, 0.0, 0.0))
#define HARMONICS_2(d)                                                                                   \
  HARMONIC(3u, 1.0925484306 * d.x * d.y, 1.0925484306 * vec3(d.y, d.x, 0.0))                             \
  HARMONIC(4u, -1.0925484306 * d.y * d.z, -1.0925484306 * vec3(0.0, d.z, d.y))                           \
  HARMONIC(5u, 0.3153915653 * (2.0 * d.z * d.z - d.x * d.x - d.y * d.y), 0.3153915653 * vec3(-2.0 * d.x, -2.0 * d.y, 4.0 * d.z)) \
  HARMONIC(6u, -1.0925484306 * d.x * d.z, -1.0925484306 * vec3(d.z, 0.0, d.x))                           \
  HARMONIC(7u, 0.5462742153 * (d.x * d.x - d.y * d.y), 0.5462742153 * vec3(2.0 * d.x, -2.0 * d.y, 0.0))
#define HARMONICS_3(d)                                                                                                   \
  HARMONIC(8u, -0.5900435899 * d.y * (3.0 * d.x * d.x - d.y * d.y), -0.5900435899 * vec3(6.0 * d.x * d.y, 3.0 * (d.x * d.x - d.y * d.y), 0.0)) \
  HARMONIC(9u, 2.8906114426 * d.x * d.y * d.z, 2.8906114426 * vec3(d.y * d.z, d.x * d.z, d.x * d.y))                     \
  HARMONIC(10u, -0.4570457995 * d.y * (4.0 * d.z * d.z - d.x * d.x - d.y * d.y), -0.4570457995 * vec3(-2.0 * d.x * d.y, 4.0 * d.z * d.z - d.x * d.x - 3.0 * d.y * d.y, 8.0 * d.y * d.z)) \
  HARMONIC(11u, 0.3731763326 * d.z * (2.0 * d.z * d.z - 3.0 * (d.x * d.x + d.y * d.y)), 0.3731763326 * vec3(-6.0 * d.x * d.z, -6.0 * d.y * d.z, 6.0 * d.z * d.z - 3.0 * (d.x * d.x + d.y * d.y))) \
  HARMONIC(12u, -0.4570457995 * d.x * (4.0 * d.z * d.z - d.x * d.x - d.y * d.y), -0.4570457995 * vec3(4.0 * d.z * d.z - 3.0 * d.x * d.x - d.y * d.y, -2.0 * d.x * d.y, 8.0 * d.x * d.z)) \
  HARMONIC(13u, 1.4453057213 * d.z * (d.x * d.x - d.y * d.y), 1.4453057213 * vec3(2.0 * d.x * d.z, -2.0 * d.y * d.z, d.x * d.x - d.y * d.y)) \
  HARMONIC(14u, -0.5900435899 * d.x * (d.x * d.x - 3.0 * d.y * d.y), -0.5900435899 * vec3(3.0 * (d.x * d.x - d.y * d.y), -6.0 * d.x * d.y, 0.0))

// Parameters of a projected splat, from texels of two floats.
#define SPLAT_TEXELS(texels, i, s)                                                                            \
  {                                                                                                           \
    uvec2 t0 = fetch(texels, 5 * i), t1 = fetch(texels, 5 * i + 1), t2 = fetch(texels, 5 * i + 2),           \
          t3 = fetch(texels, 5 * i + 3), t4 = fetch(texels, 5 * i + 4);                                       \
    s = ProjectedSplat(uintBitsToFloat(t0.x), uintBitsToFloat(t0.y), uintBitsToFloat(t1.x),                   \
                       uintBitsToFloat(t1.y), uintBitsToFloat(t2.x), uintBitsToFloat(t2.y),                   \
                       uintBitsToFloat(t3.x), uintBitsToFloat(t3.y), uintBitsToFloat(t4.x), uintBitsToFloat(t4.y)); \
  }

// Least value of a dx^2 + 2 b dx dy + c dy^2 over the pixels of a tile, from the splat's center. Precise: two kernels
// must agree.
float least_of(ProjectedSplat s, uint x, uint y) {
  vec2 from = kSplatTile * vec2(x, y) - vec2(s.u, s.v), to = from + float(kSplatTile - 1u);
  vec2 near = clamp(vec2(0.0), from, to);
  float dy = clamp(-s.b / s.c * near.x, from.y, to.y), dx = clamp(-s.b / s.a * near.y, from.x, to.x);
  precise float least = min((s.a * near.x + 2.0 * s.b * dy) * near.x + s.c * dy * dy,
                            (s.a * dx + 2.0 * s.b * near.y) * dx + s.c * near.y * near.y);
  return least;
}
// Value of least_of above which a splat has no effect.
float reach_of(ProjectedSplat s) {
  precise float reach = 2.0 * log(s.opacity / kMinSplatAlpha) + 0.01;
  return reach;
}

// Opacity of a splat at four pixels of a row; 0 below kMinSplatAlpha and where `live` is 0.
vec4 alpha_of(ProjectedSplat s, vec4 dx, float dy, vec4 transmittance, inout vec4 live) {
  vec4 power = -0.5 * (s.a * dx * dx + s.c * dy * dy) - s.b * dx * dy;
  vec4 alpha = min(s.opacity * exp(min(power, vec4(0.0))), vec4(kMaxSplatAlpha));
  alpha = mix(vec4(0.0), alpha, greaterThanEqual(alpha, vec4(kMinSplatAlpha)));
  live = mix(live, vec4(0.0), lessThan(transmittance * (1.0 - alpha), vec4(kMinTransmittance)));
  return alpha * live;
}
#endif
#endif
