// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Takes out of the image to be fused what stands in front of the map and of what the keyframe saw behind it: something
// that moves. What the keyframe saw through is also no surface of the next keyframe; what stays is one of the
// keyframe after, and is fused from then on. One thread a pixel of the coarsest level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/track.h"
#include "shaders/surface.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { MovingMaskPush push; };
layout(binding = 0, scalar) readonly buffer Points { uvec2 points[]; };
layout(binding = 1, scalar) readonly buffer Model { uvec2 model[]; };
layout(binding = 2, scalar) readonly buffer Keyframe { uvec2 keyframe[]; };  // packed, see surface.h
layout(binding = 3, scalar) buffer Live { uvec2 live[]; };                   // packed
layout(binding = 4, scalar) buffer Fusion { uvec2 fusion[]; };
layout(binding = 5, scalar) buffer Count { uint count; };

const float kReach = 2.5;  // metres: farther away single measurements stray by as much as a person is thick

// x: stands in front of the map by more than noise explains; y: the keyframe saw through it.
bvec2 judge(int x, int y) {
  int width = int(push.camera.width), height = int(push.camera.height);
  x = clamp(x, 0, width - 1);
  y = clamp(y, 0, height - 1);
  float z = uintBitsToFloat(points[y * width + x].x);
  vec3 p = ray_through(push.camera, vec2(x, y)) * z;
  vec3 m = transform(push.model_from_live, p), q = transform(push.keyframe_from_live, p);
  ivec2 im = ivec2(floor(project(push.camera, m) + 0.5)), iq = ivec2(floor(project(push.camera, q) + 0.5));
  bool in_model = z > 0.0 && m.z > 0.0 && min(im.x, im.y) >= 0 && im.x < width && im.y < height;
  bool in_keyframe = z > 0.0 && q.z > 0.0 && min(iq.x, iq.y) >= 0 && iq.x < width && iq.y < height;
  float zm = in_model ? uintBitsToFloat(model[im.y * width + im.x].x) : 0.0;
  uvec2 pk = in_keyframe ? keyframe[iq.y * width + iq.x] : uvec2(0);
  float zk = float(int((pk.x >> 24) | ((pk.y >> 24) << 8))) * 0.001;
  float gap = 0.2 + 10.0 * depth_noise(z);
  bool seen_through = z < kReach && zk > q.z + gap;
  return bvec2(seen_through && zm > m.z + gap, seen_through);
}

void main() {
  uint i = thread_index();
  if (i >= push.camera.width * push.camera.height) return;
  int x = int(i % push.camera.width), y = int(i / push.camera.width);
  bvec2 here = judge(x, y);
  // A pixel around it too: edges are blurred.
  bool moving = here.x || judge(x - 1, y).x || judge(x + 1, y).x || judge(x, y - 1).x || judge(x, y + 1).x;
  if (here.y && push.factor > 0u) live[i] &= uvec2(0x00ffffffu);
  if (!moving) return;
  atomicAdd(count, 1u);
  uint f = push.factor;
  for (uint v = 0u; v < f; ++v)
    for (uint u = 0u; u < f; ++u) fusion[(uint(y) * f + v) * push.full_width + uint(x) * f + u].x = 0u;
}
