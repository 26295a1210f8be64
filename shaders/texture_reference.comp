// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color of the map in a view, at a quarter of the size: mean over 3 x 3 points of the pixels averaged by
// texture_blur.comp, each at its nearest voxel. Points with measured depth in front of or behind the map are excluded.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/pool.h"
#include "shaders/texture.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { TextureReferencePush push; };
WORDS(0, page_table);
PAIRS(1, pixels);
PAIRS(2, model);  // as in texture_prepare.comp
layout(binding = 3, scalar) writeonly buffer Reference { uint reference[]; };  // R, G, B; alpha 0: no color
POOL(4);

void main() {
  uvec2 size = uvec2(push.camera.width >> 2, push.camera.height >> 2);
  uint i = thread_index();
  if (i >= size.x * size.y) return;
  VolumeView volume = local(push.volume);
  Pinhole camera = local(push.camera);
  Rigid world_from_camera = local(push.world_from_camera);
  ivec2 first = 4 * ivec2(i % size.x, i / size.x) - 2, last = ivec2(camera.width, camera.height) - 1;
  uvec2 half_size = uvec2(camera.width >> 1, camera.height >> 1);
  vec3 sum = vec3(0.0);
  float count = 0.0;
  for (int k = 0; k < 9; ++k) {
    ivec2 p = clamp(first + 4 * ivec2(k % 3, k / 3), ivec2(0), last);
    float measured = unpackHalf2x16(fetch(pixels, p.y * int(camera.width) + p.x).x).x;
    uvec2 h = min(uvec2(p) >> 1, half_size - 1u);
    float z = uintBitsToFloat(fetch(model, int(h.y * half_size.x + h.x)).x);
    if (z == 0.0 || abs(measured - z) > push.tolerance + 3.0 * depth_noise(z)) continue;
    vec3 at = rotate(world_from_camera, z * ray_through(camera, vec2(p))) + world_from_camera.t;
    ivec3 voxel = ivec3(floor(at / volume.voxel_size + 0.5)), brick = voxel >> 3;
    if (!in_window(volume, brick)) continue;
    uint slot = slot_of_entry(fetch(page_table, int(table_index(volume, brick))));
    if (slot == kNoSlot) continue;
    uint color = voxel_in(volume.voxels, voxel_index(slot, voxel)).y;
    if (color < 0x1000000u) continue;
    sum += color_of(color);
    count += 1.0;
  }
  reference[i] = packUnorm4x8(vec4(sum / max(count, 1.0), count > 0.0 ? 1.0 : 0.0));
}
