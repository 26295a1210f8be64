// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Integrates a depth image into bricks (Curless & Levoy 1996, eq. 3 and 4). One workgroup per brick; a thread processes
// columns of eight voxels along z. Voxels in front of the measurement by more than the truncation become free space,
// which carves away removed surfaces. A settled brick takes turns: every kInterval-th view is integrated, with the
// weight of all of them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_KHR_shader_subgroup_vote : require
#include "shaders/noise.h"
#include "shaders/pool.h"
layout(local_size_x = 64, local_size_x_id = 15) in;
layout(push_constant, scalar) uniform Push { TsdfIntegratePush push; };
layout(binding = 0, scalar) readonly buffer Selection { Selected selected[]; };
layout(binding = 1, scalar) readonly buffer Slots { SlotState slots[]; };
PAIRS(2, fusion);  // (depth bits, color)
layout(binding = 3, scalar) writeonly buffer Changed { uint changed[]; };   // by selected brick: 1 if a distance has
                                                                            // changed
layout(binding = 4, scalar) uniform Counts { FusionCounts counts; };
POOL(5);

// A single 64-bit store instead of two of 32 bits: half the memory cost on a CPU device.
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer WideVoxels { uint64_t v[]; };

const float kMaxColorWeight = 32.0;
const float kSigmas = 3.0;         // plus a voxel, maximum disagreement of two views of the same side
const float kSettledViews = 16.0;  // minimum weight of a settled voxel, in views like the current one
const uint kSamples = 16u;         // voxels of a brick tested for it: two in each layer along each axis
const uint kInterval = 4u;         // views of a settled brick per integrated view
const float kMinTrust = 0.1;       // for twice that distance behind the surface

// Conversions go through int: CPU devices have no vector instruction for unsigned conversions.
vec3 channels(uint rgb) { return vec3(ivec3(rgb & 0xffu, (rgb >> 8) & 0xffu, (rgb >> 16) & 0xffu)); }

void main() {
  if (group_index() >= counts.selected) return;
  // Reads everything once for all columns, because reads are expensive on a CPU device.
  Selected brick = selected[group_index()];
  Rigid camera_from_submap = local(push.camera_from_submap);
  float voxel_size = push.voxel_size, inverse_truncation = 1.0 / push.truncation;
  vec3 corner = transform(camera_from_submap, vec3(slots[brick.slot].brick * 8) * voxel_size);
  vec3 step_x = camera_from_submap.x * voxel_size, step_y = camera_from_submap.y * voxel_size,
       step_z = camera_from_submap.z * voxel_size;
  WideVoxels voxels = WideVoxels(push.voxels);
  vec2 focal = vec2(push.camera.fx, push.camera.fy), center = vec2(push.camera.cx, push.camera.cy) + 0.5;
  int width = int(push.camera.width), height = int(push.camera.height);
  float max_weight = push.max_weight;
  bool has_color = push.has_color != 0u;
  // Nothing is integrated behind the farthest measurement plus the truncation. Slightly enlarged; the exact test uses
  // the distances.
  float farthest = 1.001 * (brick.farthest + push.truncation);
  // Means are stored as integer levels, so an increment is rounded up with a probability equal to its fraction, by a
  // threshold that changes per frame (Weyl sequence of the golden ratio; columns have different offsets). With rounding
  // to nearest, a mean of many frames would ignore changes of less than 16 levels.
  float first_threshold = 0.618034 * float(int(push.fused_count & 4095u));

  // A brick is settled if it has observed samples, and each in view has the weight of many such views and agrees with
  // this one. Each subgroup tests all samples; lanes by thread, because lavapipe numbers a subgroup of 16 incorrectly
  // (Mesa 22.3).
  uint lanes = min(gl_SubgroupSize, kSamples);
  bool is_known = false, agrees = true;
  for (uint i = gl_LocalInvocationID.x % lanes; i < kSamples; i += lanes) {
    uint x = 2u * (i >> 2) + (i & 1u), y = 2u * (i & 3u) + ((i >> 2) & 1u), k = (2u * (i >> 2) + 5u * (i & 3u)) & 7u;
    vec3 p = corner + float(int(x)) * step_x + float(int(y)) * step_y + float(int(k)) * step_z;
    vec2 pixel = focal * p.xy * (1.0 / p.z) + center;
    bool inside = p.z > 0.0 && min(pixel.x, pixel.y) >= 0.0 && pixel.x < float(width) && pixel.y < float(height);
    float z = inside ? uintBitsToFloat(fetch(fusion, int(pixel.y) * width + int(pixel.x)).x) : 0.0;
    float offset = z - p.z;
    uint word = voxel_in(push.voxels, (brick.slot << 9) | (x << 6) | (y << 3) | k).x;
    float change = abs(min(offset, push.truncation) - voxel_distance(word) * push.truncation);
    bool is_in_view = z > 0.0 && offset > -push.truncation;
    bool is_settled =
        voxel_weight(word) >= kSettledViews * depth_weight(z) && change <= voxel_size + kSigmas * depth_noise(z);
    is_known = is_known || voxel_weight(word) > 0.0;
    agrees = agrees && (is_settled || !is_in_view);
  }
  // Before another subgroup writes. A constant condition: on a CPU device a workgroup is one subgroup, and a barrier
  // would cost as much as it saves.
  if (gl_WorkGroupSize.x > kSamples) barrier();
  float views = 1.0;
  if (subgroupAny(is_known) && subgroupAll(agrees)) {
    uvec3 b = uvec3(slots[brick.slot].brick);
    if ((b.x * 3u + b.y * 5u + b.z * 7u + push.fused_count) % kInterval != 0u) return;
    views = float(int(kInterval));
  }

  uint differs = 0u;
  for (uint column = gl_LocalInvocationID.x; column < 64u; column += gl_WorkGroupSize.x) {
    vec3 p = corner + float(int(column >> 3)) * step_x + float(int(column & 7u)) * step_y;
    uint at = (brick.slot << 9) | (column << 3);
    float threshold = fract(first_threshold + 0.381966 * float(int(column)));
    float along = (farthest - p.z) / step_z.z;
    uint begin = step_z.z < 0.0 ? uint(clamp(floor(along), 0.0, 8.0)) : 0u;
    uint end = step_z.z < 0.0 ? 8u : uint(clamp(ceil(along), 0.0, 8.0));
    p += float(int(begin)) * step_z;
    for (uint k = begin; k < end; ++k, p += step_z) {
      vec2 pixel = focal * p.xy * (1.0 / p.z) + center;
      bool inside = p.z > 0.0 && min(pixel.x, pixel.y) >= 0.0 && pixel.x < float(width) && pixel.y < float(height);
      uvec2 measured = inside ? fetch(fusion, int(pixel.y) * width + int(pixel.x)) : uvec2(0);
      float z = uintBitsToFloat(measured.x);
      float sdf = (z - p.z) * inverse_truncation;
      if (z > 0.0 && sdf > -1.0) {
        uvec2 old = voxel_in(push.voxels, at + k);
        float weight = views * depth_weight(z);
        float old_weight = voxel_weight(old.x);
        float d = voxel_distance(old.x);
        // Opposite signs may mean that a thin sheet was seen from both sides: the value far behind the surface then
        // loses its weight to the value of the other side.
        float behind = -min(d, sdf) * push.truncation, near = voxel_size + kSigmas * depth_noise(z);
        float trust = d * sdf < 0.0 ? clamp(2.0 - behind / near, kMinTrust, 1.0) : 1.0;
        weight *= sdf < 0.0 ? trust : 1.0;
        old_weight *= d < 0.0 ? trust : 1.0;
        float sum = old_weight + weight;
        d += (min(sdf, 1.0) - d) * (weight / sum);
        uint word =
            distance_and_weight(int(roundEven(d * kDistanceUnits)), int(min(sum, max_weight) * kWeightUnits + 0.5));
        differs |= (word ^ old.x) & 0xffffu;
        differs |= old.x < 0x10000u ? 1u : 0u;  // first observation
        uint rgb = old.y;
        if (has_color && sdf < 1.0 && measured.y >= 0x1000000u) {
          float n = float(int(rgb >> 24));
          vec3 mean = channels(rgb);
          mean += (channels(measured.y) - mean) * (views / (n + views)) + threshold;
          rgb = uint(int(mean.x) | (int(mean.y) << 8) | (int(mean.z) << 16) |
                     (int(min(n + views, kMaxColorWeight)) << 24));
        }
        voxels.v[at + k] = pack64(uvec2(word, rgb));
      }
    }
  }
  if (differs != 0u) changed[group_index()] = 1u;
}
