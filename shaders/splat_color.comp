// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color of each visible splat in the direction of view.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatViewPush push; };
WORDS(0, order);
FLOATS(1, model);
FLOATS(2, harmonics);
layout(binding = 3, scalar) buffer Projected { ProjectedSplat projected[]; };

vec3 three(uint plane, uint i) {
  int at = int(plane * push.count + i), count = int(push.count);
  return vec3(fetch(model, at), fetch(model, at + count), fetch(model, at + 2 * count));
}
vec3 harmonic(uint k, uint i) {
  int at = int(3u * k * push.count + i), count = int(push.count);
  return vec3(fetch(harmonics, at), fetch(harmonics, at + count), fetch(harmonics, at + 2 * count));
}

void main() {
  uint rank = thread_index();
  if (rank >= push.visible) return;
  uint i = fetch(order, int(rank));
  vec3 center = -inverse_rotate(push.camera_from_world, push.camera_from_world.t);
  vec3 d = normalize(three(kSplatPosition, i) - center);
  vec3 color = 0.5 + 0.2820947918 * three(kSplatColor, i);
#define HARMONIC(k, value, derivative) color += (value) * harmonic(k, i);
  if (push.degree > 0u) { HARMONICS_1(d) }
  if (push.degree > 1u) { HARMONICS_2(d) }
  if (push.degree > 2u) { HARMONICS_3(d) }
  color = max(color, vec3(0.0));
  projected[i].red = color.x;
  projected[i].green = color.y;
  projected[i].blue = color.z;
}
