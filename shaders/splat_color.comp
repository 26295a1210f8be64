// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color of each visible splat in the direction of view.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatViewPush push; };
layout(binding = 0, scalar) readonly buffer Order { uint order[]; };
layout(binding = 1, scalar) readonly buffer Model { float model[]; };
layout(binding = 2, scalar) readonly buffer Harmonics { float harmonics[]; };
layout(binding = 3, scalar) buffer Projected { ProjectedSplat projected[]; };

vec3 position_of(uint i) { return vec3(model[i], model[push.stride + i], model[2u * push.stride + i]); }
vec3 harmonic(uint k, uint i) {
  uint at = 3u * k * push.stride + i;
  return vec3(harmonics[at], harmonics[at + push.stride], harmonics[at + 2u * push.stride]);
}

void main() {
  uint rank = thread_index();
  if (rank >= push.count) return;
  uint i = order[rank], at = kSplatColor * push.stride + i;
  vec3 center = -inverse_rotate(push.camera_from_world, push.camera_from_world.t);
  vec3 d = normalize(position_of(i) - center);
  vec3 color = 0.5 + 0.2820947918 * vec3(model[at], model[at + push.stride], model[at + 2u * push.stride]);
#define HARMONIC(k, value, derivative) color += (value) * harmonic(k, i);
  if (push.degree > 0u) { HARMONICS_1(d) }
  if (push.degree > 1u) { HARMONICS_2(d) }
  if (push.degree > 2u) { HARMONICS_3(d) }
  color = max(color, vec3(0.0));
  projected[i].red = color.x;
  projected[i].green = color.y;
  projected[i].blue = color.z;
}
