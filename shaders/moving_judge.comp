// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Classifies each pixel of the coarsest level by comparison with the map and the keyframe; see moving_mask.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/track.h"
#include "shaders/surface.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { MovingJudgePush push; };
PAIRS(0, points);
PAIRS(1, model);
PAIRS(2, keyframe);  // packed, see surface.h
layout(binding = 3, scalar) writeonly buffer Verdicts { uint verdicts[]; };

const float kReach = 2.5;  // meters; beyond, single measurements deviate by as much as the thickness of a person

void main() {
  int width = int(push.camera.width), height = int(push.camera.height);
  ivec2 at = thread_place();
  if (at.x >= width || at.y >= height) return;
  int i = at.y * width + at.x;
  float z = uintBitsToFloat(fetch(points, i).x);
  vec3 p = ray_through(push.camera, vec2(at)) * z;
  vec3 m = transform(push.model_from_live, p), q = transform(push.keyframe_from_live, p);
  ivec2 im = ivec2(floor(project(push.camera, m) + 0.5)), iq = ivec2(floor(project(push.camera, q) + 0.5));
  bool in_model = z > 0.0 && m.z > 0.0 && min(im.x, im.y) >= 0 && im.x < width && im.y < height;
  bool in_keyframe = z > 0.0 && q.z > 0.0 && min(iq.x, iq.y) >= 0 && iq.x < width && iq.y < height;
  float zm = in_model ? uintBitsToFloat(fetch(model, im.y * width + im.x).x) : 0.0;
  uvec2 pk = in_keyframe ? fetch(keyframe, iq.y * width + iq.x) : uvec2(0);
  float zk = float(int((pk.x >> 24) | ((pk.y >> 24) << 8))) * 0.001;
  float gap = 0.2 + 10.0 * depth_noise(z);
  bool seen_through = z < kReach && zk > q.z + gap;
  verdicts[i] = (seen_through && zm > m.z + gap ? kInFrontOfMap : 0u) | (seen_through ? kSeenThrough : 0u);
}
