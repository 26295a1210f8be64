// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Masks moving objects in the image to integrate: pixels in front of both the map and the keyframe's surface. Pixels in
// the keyframe's free space also lose their depth in the next keyframe. An object at rest is part of the keyframe after
// the next and is integrated from then on. One thread per pixel of the coarsest level. A first dispatch only counts; a
// count above the limit indicates a wrong pose, and no pixel is masked.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/fetch.h"
#include "shaders/track.h"
layout(local_size_x = 16, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { MovingMaskPush push; };
WORDS(0, verdicts);
layout(binding = 1, scalar) buffer Live { uvec2 live[]; };  // packed, see surface.h
layout(binding = 2, scalar) buffer Fusion { uvec2 fusion[]; };
layout(binding = 3, scalar) buffer Count { uint count; };

uint verdict(ivec2 p) {
  p = clamp(p, ivec2(0), ivec2(push.width, push.height) - 1);
  return fetch(verdicts, p.y * int(push.width) + p.x);
}

void main() {
  ivec2 at = thread_place();
  if (at.x >= int(push.width) || at.y >= int(push.height)) return;
  uint here = verdict(at);
  // Dilated by one pixel, because edges are blurred.
  uint around = here | verdict(at - ivec2(1, 0)) | verdict(at + ivec2(1, 0)) | verdict(at - ivec2(0, 1)) | verdict(at + ivec2(0, 1));
  bool moving = (around & kInFrontOfMap) != 0u;
  if (push.only_count != 0u) {
    if (moving) atomicAdd(count, 1u);
    return;
  }
  if (count > push.max_count) return;
  if ((here & kSeenThrough) != 0u) live[at.y * int(push.width) + at.x] &= uvec2(0x00ffffffu);
  if (!moving) return;
  uint f = push.factor;
  for (uint v = 0u; v < f; ++v)
    for (uint u = 0u; u < f; ++u) fusion[(uint(at.y) * f + v) * push.full_width + uint(at.x) * f + u].x = 0u;
}
