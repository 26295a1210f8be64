// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Step of Adam (Kingma & Ba 2015) for the visible splats only.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/splats.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SplatAdamPush push; };
WORDS(0, order);
FLOATS(1, gradients);
layout(binding = 2, scalar) buffer Model { float model[]; };
layout(binding = 3, scalar) buffer Means { float means[]; };
layout(binding = 4, scalar) buffer Squares { float squares[]; };

const float kBeta1 = 0.9, kBeta2 = 0.999, kEpsilon = 1e-15;

void main() {
  uint rank = gl_GlobalInvocationID.x, plane = gl_GlobalInvocationID.y;
  if (rank >= push.visible) return;
  uint at = plane * push.count + fetch(order, int(rank));
  float gradient = fetch(gradients, int(at));
  float mean = mix(gradient, means[at], kBeta1), square = mix(gradient * gradient, squares[at], kBeta2);
  means[at] = mean;
  squares[at] = square;
  float rate = plane < kSplatScale      ? push.position
               : plane < kSplatRotation ? push.scale
               : plane < kSplatOpacity  ? push.rotation
               : plane < kSplatColor    ? push.opacity
                                        : push.color;
  model[at] -= rate * (mean / push.correction1) / (sqrt(square / push.correction2) + kEpsilon);
}
