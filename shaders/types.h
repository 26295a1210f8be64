// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Types shared by GLSL (scalar block layout) and C++. Include first in every shader and stage header.
#ifndef CAIRN_TYPES_H
#define CAIRN_TYPES_H
#ifdef __cplusplus
#include <Eigen/Geometry>
#include <cstdint>

#include "cairn/mapping/camera.hpp"
namespace cairn::shader {
using uint = std::uint32_t;
/// N numbers without padding, copied as bytes; Eigen's own types are not trivially copyable.
template <class T>
struct Pair {
  T x, y;
};
template <class T>
struct Triple {
  T x, y, z;
  Triple() = default;
  constexpr Triple(T x_, T y_, T z_) : x(x_), y(y_), z(z_) {}
  template <class Derived>
  Triple(const Eigen::MatrixBase<Derived>& m) : x(m[0]), y(m[1]), z(m[2]) {}
  operator Eigen::Matrix<T, 3, 1>() const { return {x, y, z}; }
};
using vec2 = Pair<float>;
using vec3 = Triple<float>;
using ivec3 = Triple<int>;
using uvec2 = Pair<uint>;
#else
#extension GL_EXT_scalar_block_layout : require
#define constexpr  // qualifier of functions shared with C++
#endif

struct Pinhole {  // pixels; see cairn/mapping/camera.hpp
  uint width;
  uint height;
  float fx;
  float fy;
  float cx;
  float cy;
};

struct Rigid {  // rigid transform: columns of the rotation, then the translation in meters
  vec3 x;
  vec3 y;
  vec3 z;
  vec3 t;
};

struct Groups {  // number of workgroups, in the layout of dispatchIndirect
  uint x;
  uint y;
  uint z;
};

#ifdef __cplusplus
inline Pinhole pinhole(const Camera& c) {
  return {static_cast<uint>(c.width), static_cast<uint>(c.height), static_cast<float>(c.fx),
          static_cast<float>(c.fy),   static_cast<float>(c.cx),    static_cast<float>(c.cy)};
}
/// Device address of a Buffer for shaders; low word first.
template <class Buffer>
uvec2 address(const Buffer& buffer) {
  return {static_cast<uint>(buffer.address()), static_cast<uint>(buffer.address() >> 32)};
}
inline Rigid rigid(const Eigen::Isometry3d& t) {
  const Eigen::Matrix<float, 3, 4> m = t.matrix().topRows<3>().cast<float>();
  return {m.col(0), m.col(1), m.col(2), m.col(3)};
}
}  // namespace cairn::shader
#else
// Devices guarantee 65,535 workgroups along x only: gpu::Kernel folds longer rows along y, and the shader must skip the
// threads beyond the end. For shaders with 64 threads per group:
uint group_index() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
uint thread_index() { return group_index() * 64u + gl_LocalInvocationID.x; }
// For shaders with a row of threads per row of pixels: a CPU device does not vectorize integer division, and i / width
// would cost as much as the rest of a small kernel.
ivec2 thread_place() { return ivec2(gl_GlobalInvocationID.xy); }

// Copies member by member, for use in loops and branches: a struct copy of push constants is read again at each use,
// and a CPU device reads push constants slowly.
Pinhole local(Pinhole c) { return Pinhole(c.width, c.height, c.fx, c.fy, c.cx, c.cy); }
Rigid local(Rigid m) { return Rigid(m.x, m.y, m.z, m.t); }

vec3 rotate(Rigid m, vec3 v) { return m.x * v.x + m.y * v.y + m.z * v.z; }
vec3 transform(Rigid m, vec3 p) { return rotate(m, p) + m.t; }
Rigid compose(Rigid a, Rigid b) { return Rigid(rotate(a, b.x), rotate(a, b.y), rotate(a, b.z), transform(a, b.t)); }
vec3 inverse_rotate(Rigid m, vec3 v) { return vec3(dot(m.x, v), dot(m.y, v), dot(m.z, v)); }
vec3 inverse_transform(Rigid m, vec3 p) { return inverse_rotate(m, p - m.t); }
vec3 ray_through(Pinhole c, vec2 pixel) { return vec3((pixel - vec2(c.cx, c.cy)) / vec2(c.fx, c.fy), 1.0); }
vec2 project(Pinhole c, vec3 p) { return vec2(c.fx, c.fy) * p.xy / p.z + vec2(c.cx, c.cy); }

// Unit vectors in 32 bits (Cigolle et al. 2014, octahedral). 0 is never a vector; it means "none".
uint pack_normal(vec3 n) {
  n /= abs(n.x) + abs(n.y) + abs(n.z);
  vec2 e = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  uint code = packUnorm2x16(e * 0.5 + 0.5);
  return code == 0u ? 0xffffffffu : code;  // both corners of the square are (0, 0, -1)
}
vec3 unpack_normal(uint code) {
  vec2 e = unpackUnorm2x16(code) * 2.0 - 1.0;
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  float t = max(-n.z, 0.0);
  n.xy += vec2(n.x >= 0.0 ? -t : t, n.y >= 0.0 ? -t : t);
  return normalize(n);
}
#endif

#endif
