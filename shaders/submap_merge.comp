// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Fuses moved and deformed submaps into world bricks: each voxel is the weighted mean of the submaps' distances at its
// position, interpolated if all surrounding voxels were observed. One workgroup per brick.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/volume.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SubmapMergePush push; };
layout(binding = 0, scalar) readonly buffer Targets { MergeTarget targets[]; };
layout(binding = 1, scalar) readonly buffer Sources { MergeSource sources[]; };
layout(binding = 2, scalar) writeonly buffer Merged { uvec2 merged[]; };

// Conversions go through int, and colors use the nearest voxel only: on a CPU device memory accesses and unsigned
// conversions dominate the cost.

const float kAll = 0.999;  // minimum sum of the shares of the four interpolated voxels

uint index_of(uint source, ivec3 voxel) {
  ivec3 b = voxel >> 3, v = voxel & 7;
  return (sources[source].slots[b.x + 3 * b.y + 9 * b.z] << 9) | uint((v.x << 6) | (v.y << 3) | v.z);
}

// Contribution of a voxel to the distance, the weight, and the observed share.
vec3 part(uint source, ivec3 voxel, float share) {
  int word = int(Voxels(push.voxels).v[index_of(source, voxel)].x);
  float weight = float((word >> 16) & 0xffff);
  return share * vec3(float(bitfieldExtract(word, 0, 16)), weight, weight > 0.0 ? 1.0 : 0.0);
}

// Running sums of an output voxel.
struct Sum {
  float distance, weight;
  vec4 color;  // with its weight
};

void add(inout Sum sum, uint source, vec3 at) {
  at = max(at, vec3(0.0));
  ivec3 low = ivec3(at), high = low + 1;
  vec3 h = at - vec3(low);  // shares of the high corner
  // Tetrahedral interpolation in the cell: from the low corner to the high corner, along the axis of the largest share
  // first. Half the accesses of trilinear interpolation, and equally exact on planes.
  bvec3 is_first = bvec3(h.x >= h.y && h.x >= h.z, h.y > h.x && h.y >= h.z, h.z > h.x && h.z > h.y);
  bvec3 is_last = bvec3(h.x < h.y && h.x < h.z, h.y <= h.x && h.y < h.z, h.z <= h.x && h.z <= h.y);
  float largest = max(h.x, max(h.y, h.z)), smallest = min(h.x, min(h.y, h.z));
  float middle = h.x + h.y + h.z - largest - smallest;
  vec3 found = part(source, low, 1.0 - largest);
  found += part(source, mix(low, high, is_first), largest - middle);
  found += part(source, mix(high, low, is_last), middle - smallest);
  found += part(source, high, smallest);
  float weight = found.z > kAll ? found.y : 0.0;
  sum.distance += weight * found.x;
  sum.weight += weight;

  int rgbn = int(Voxels(push.voxels).v[index_of(source, ivec3(at + 0.5))].y);
  float shade = weight > 0.0 ? float((rgbn >> 24) & 0xff) : 0.0;
  sum.color += shade * vec4(ivec4(rgbn & 0xff, (rgbn >> 8) & 0xff, (rgbn >> 16) & 0xff, 1));
}

uvec2 voxel_of(Sum sum) {
  float mean = sum.weight > 0.0 ? sum.distance / sum.weight : 0.0;
  int weight = int(min(sum.weight, push.max_weight * kWeightUnits) + 0.5);
  ivec3 byte = ivec3((sum.color.w > 0.0 ? sum.color.rgb / sum.color.w : vec3(0.0)) + 0.5);
  uint rgb = uint(byte.x | (byte.y << 8) | (byte.z << 16) | (int(min(sum.color.w, 255.0)) << 24));
  return weight > 0 ? uvec2(distance_and_weight(int(round(mean)), weight), rgb) : uvec2(0);
}

void main() {
  if (group_index() >= push.targets) return;
  MergeTarget target = targets[group_index()];
  int column = int(gl_LocalInvocationID.x);
  uint to = (group_index() << 9) | uint(column << 3);
  // Four voxels at a time, to read a source's transform only once for them.
  for (int z = 0; z < 8; z += 4) {
    const Sum kNone = Sum(0.0, 0.0, vec4(0.0));
    Sum a = kNone, b = kNone, c = kNone, d = kNone;
    for (uint s = target.first; s < target.first + target.count; ++s) {
      Rigid source_from_target = sources[s].source_from_target;
      vec3 at = transform(source_from_target, vec3(ivec3(column >> 3, column & 7, z)));
      add(a, s, at);
      add(b, s, at + source_from_target.z);
      add(c, s, at + 2.0 * source_from_target.z);
      add(d, s, at + 3.0 * source_from_target.z);
    }
    merged[to | uint(z)] = voxel_of(a);
    merged[to | uint(z + 1)] = voxel_of(b);
    merged[to | uint(z + 2)] = voxel_of(c);
    merged[to | uint(z + 3)] = voxel_of(d);
  }
}
