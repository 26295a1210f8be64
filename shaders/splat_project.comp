// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Projects each splat: 2D Gaussian, covered tiles and depth key.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatViewPush push; };
FLOATS(0, model);
layout(binding = 1, scalar) writeonly buffer Projected { ProjectedSplat projected[]; };
layout(binding = 2, scalar) writeonly buffer Tiles { uvec2 tiles[]; };  // first and last: x in the lower 16 bits, y in the upper
layout(binding = 3, scalar) writeonly buffer Keys { uint keys[]; };
layout(binding = 4, scalar) writeonly buffer Order { uint order[]; };

float value(uint plane, uint i) { return fetch(model, int(plane * push.count + i)); }

void main() {
  uint i = thread_index();
  if (i >= push.count) return;
  order[i] = i;
  keys[i] = kNoSplatKey;
  tiles[i] = uvec2(1u, 0u);
  Pinhole camera = local(push.camera);
  Rigid pose = local(push.camera_from_world);
  vec3 p = transform(pose, vec3(value(kSplatPosition, i), value(kSplatPosition + 1u, i), value(kSplatPosition + 2u, i)));
  if (p.z < kSplatNear) return;
  vec3 scale = exp(vec3(value(kSplatScale, i), value(kSplatScale + 1u, i), value(kSplatScale + 2u, i)));
  vec4 q = vec4(value(kSplatRotation, i), value(kSplatRotation + 1u, i), value(kSplatRotation + 2u, i),
                value(kSplatRotation + 3u, i));
  float opacity = 1.0 / (1.0 + exp(-value(kSplatOpacity, i)));
  mat3 turn = mat3(pose.x, pose.y, pose.z) * rotation_of(q / max(length(q), 1e-12));
  vec3 u0, u1;
  factor_of(camera, clamped_slope(camera, p), p.z, turn, u0, u1);
  vec3 n0 = u0 * scale, n1 = u1 * scale;
  float a = dot(n0, n0) + push.low_pass, b = dot(n0, n1), c = dot(n1, n1) + push.low_pass, det = a * c - b * b;
  if (!(det > 0.0)) return;
  vec2 at = project(camera, p);
  ivec4 rect = tiles_of(at, a, c, opacity, camera.width, camera.height);
  if (rect.x > rect.z) return;
  keys[i] = min((floatBitsToUint(p.z) - floatBitsToUint(kSplatNear)) >> 3, kNoSplatKey - 1u);
  tiles[i] = uvec2(rect.x | rect.y << 16, rect.z | rect.w << 16);
  projected[i] = ProjectedSplat(at.x, at.y, c / det, -b / det, a / det, opacity, 0.0, 0.0, 0.0, p.z);
}
