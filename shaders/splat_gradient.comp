// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gradients of the parameters of each visible splat: sum over its tiles, and the chain rule through color and
// projection. Planes as in the model; values of invisible splats are not written.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatViewPush push; };
WORDS(0, order);
FLOATS(1, model);
FLOATS(2, harmonics);
PAIRS(3, projected);
layout(binding = 4, scalar) readonly buffer Offsets { uint offsets[]; };
FLOATS(5, slot_shapes);
FLOATS(6, slot_colors);
layout(binding = 7, scalar) writeonly buffer Gradients { float gradients[]; };
layout(binding = 8, scalar) writeonly buffer HarmonicGradients { float harmonic_gradients[]; };
layout(binding = 9, scalar) buffer Motion { vec2 motion[]; };  // by splat: sum of the length of its pixel gradient, and count

float value(uint plane, uint i) { return fetch(model, int(plane * push.count + i)); }
void store(uint plane, uint i, float gradient) { gradients[plane * push.count + i] = gradient; }
void store(uint plane, uint i, vec3 gradient) {
  store(plane, i, gradient.x);
  store(plane + 1u, i, gradient.y);
  store(plane + 2u, i, gradient.z);
}
vec3 harmonic(uint k, uint i) {
  int at = int(3u * k * push.count + i), count = int(push.count);
  return vec3(fetch(harmonics, at), fetch(harmonics, at + count), fetch(harmonics, at + 2 * count));
}
void store_harmonic(uint k, uint i, vec3 gradient) {
  uint at = 3u * k * push.count + i;
  harmonic_gradients[at] = gradient.x;
  harmonic_gradients[at + push.count] = gradient.y;
  harmonic_gradients[at + 2u * push.count] = gradient.z;
}

void main() {
  uint rank = thread_index();
  if (rank >= push.visible) return;
  uint i = fetch(order, int(rank));
  int end = int(rank + 1u < push.count ? offsets[rank + 1u] : push.entries) * int(kSplatSlot);
  vec2 of_at = vec2(0.0);
  vec3 of_conic = vec3(0.0), of_color = vec3(0.0);
  float of_opacity = 0.0, of_depth = 0.0;
  for (int at = int(offsets[rank] * kSplatSlot); at < end; at += int(kSplatSlot)) {
    of_at += vec2(fetch(slot_shapes, at), fetch(slot_shapes, at + 1));
    of_conic += vec3(fetch(slot_shapes, at + 2), fetch(slot_shapes, at + 3), fetch(slot_shapes, at + 4));
    of_opacity += fetch(slot_colors, at);
    of_color += vec3(fetch(slot_colors, at + 1), fetch(slot_colors, at + 2), fetch(slot_colors, at + 3));
    of_depth += fetch(slot_colors, at + 4);
  }
  ProjectedSplat s;
  int splat = int(i);
  SPLAT_TEXELS(projected, splat, s)
  Pinhole camera = local(push.camera);
  Rigid pose = local(push.camera_from_world);
  vec3 position = vec3(value(kSplatPosition, i), value(kSplatPosition + 1u, i), value(kSplatPosition + 2u, i));
  motion[i] += vec2(length(of_at * vec2(camera.width, camera.height)), 1.0);

  // Color.
  of_color = mix(vec3(0.0), of_color, greaterThan(vec3(s.red, s.green, s.blue), vec3(0.0)));
  store(kSplatColor, i, 0.2820947918 * of_color);
  vec3 ray = position + inverse_rotate(pose, pose.t), d = normalize(ray), of_direction = vec3(0.0);
#define HARMONIC(k, value, derivative)           \
  store_harmonic(k, i, (value) * of_color);    \
  of_direction += dot(of_color, harmonic(k, i)) * (derivative);
  if (push.degree > 0u) { HARMONICS_1(d) }
  if (push.degree > 1u) { HARMONICS_2(d) }
  if (push.degree > 2u) { HARMONICS_3(d) }
  vec3 of_position = (of_direction - d * dot(d, of_direction)) / length(ray);

  // 2D covariance: dL/dV = -Q dL/dQ Q with the conic Q.
  float ga = of_conic.x, gb = 0.5 * of_conic.y, gc = of_conic.z;
  float m00 = s.a * ga + s.b * gb, m01 = s.a * gb + s.b * gc, m10 = s.b * ga + s.c * gb, m11 = s.b * gb + s.c * gc;
  float of_a = -(m00 * s.a + m01 * s.b), of_c = -(m10 * s.b + m11 * s.c), of_b = -(m00 * s.b + m01 * s.c);
  // V = N N^T, N = U S, U = J W R.
  vec3 p = transform(pose, position);
  vec3 scale = exp(vec3(value(kSplatScale, i), value(kSplatScale + 1u, i), value(kSplatScale + 2u, i)));
  vec4 unnormalized = vec4(value(kSplatRotation, i), value(kSplatRotation + 1u, i), value(kSplatRotation + 2u, i),
                           value(kSplatRotation + 3u, i));
  float norm = max(length(unnormalized), 1e-12);
  vec4 q = unnormalized / norm;
  mat3 world = mat3(pose.x, pose.y, pose.z), turn = world * rotation_of(q);
  vec2 slope = clamped_slope(camera, p);
  vec3 u0, u1;
  factor_of(camera, slope, p.z, turn, u0, u1);
  vec3 n0 = u0 * scale, n1 = u1 * scale;
  vec3 of_n0 = 2.0 * (of_a * n0 + of_b * n1), of_n1 = 2.0 * (of_c * n1 + of_b * n0);
  store(kSplatScale, i, (of_n0 * u0 + of_n1 * u1) * scale);
  vec3 of_u0 = of_n0 * scale * camera.fx / p.z, of_u1 = of_n1 * scale * camera.fy / p.z;
  // Rows of dL/d(W R), since u0 = fx / z (row 0 - slope.x row 2) and u1 = fy / z (row 1 - slope.y row 2).
  mat3 of_turn = transpose(mat3(of_u0, of_u1, -slope.x * of_u0 - slope.y * of_u1));
  mat3 r = transpose(world) * of_turn;  // dL/dR; r[column][row]
  vec4 of_q = 2.0 * vec4(q.y * (r[1].z - r[2].y) + q.z * (r[2].x - r[0].z) + q.w * (r[0].y - r[1].x),
                         q.x * (r[1].z - r[2].y) + q.z * (r[1].x + r[0].y) + q.w * (r[2].x + r[0].z) - 2.0 * q.y * (r[1].y + r[2].z),
                         q.x * (r[2].x - r[0].z) + q.y * (r[1].x + r[0].y) + q.w * (r[2].y + r[1].z) - 2.0 * q.z * (r[0].x + r[2].z),
                         q.x * (r[0].y - r[1].x) + q.y * (r[2].x + r[0].z) + q.z * (r[2].y + r[1].z) - 2.0 * q.w * (r[0].x + r[1].y));
  of_q = (of_q - q * dot(q, of_q)) / norm;
  store(kSplatRotation, i, of_q.xyz);
  store(kSplatRotation + 3u, i, of_q.w);
  store(kSplatOpacity, i, of_opacity * s.opacity * (1.0 - s.opacity));

  // Camera frame: through the mean, the depth, and the factor's z and slope.
  vec3 row2 = vec3(turn[0].z, turn[1].z, turn[2].z);
  vec2 of_slope = -vec2(dot(of_u0, row2), dot(of_u1, row2));
  of_slope *= vec2(equal(slope, p.xy / p.z));
  vec2 of_pixel = of_at * vec2(camera.fx, camera.fy) + of_slope;  // of p.xy / p.z
  vec3 of_p = vec3(of_pixel / p.z, of_depth - dot(of_pixel, p.xy) / (p.z * p.z) -
                                       (dot(of_n0 * scale, u0) + dot(of_n1 * scale, u1)) / p.z);
  store(kSplatPosition, i, of_position + inverse_rotate(pose, of_p));
}
