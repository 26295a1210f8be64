// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Lower wavefront of the dynamic brushfire (Lau et al. 2013), one step: the voxels of a list offer their nearest site
// to the neighbors on the far side. Neighbors for which this site is nearer than their current site form the next list
// (vector propagation: Danielsson 1980).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfWavePush push; };
PAIRS(0, list);
layout(binding = 1, scalar) writeonly buffer Next { EsdfEntry next[]; };
layout(binding = 2, scalar) writeonly buffer Dirty { uint dirty[]; };
PAIRS(3, nearest);
WORDS(4, surface);
WORDS(5, places);
WORDS(6, table);
WORDS(7, dirty_blocks);

const float kNear = 1.5;    // voxels; closer to the site, all neighbors get the offer
const float kAside = 0.1;   // share of the largest component; along axes with less, both sides get the offer

void offer(uint from, uint site, bool is_final, uint step, uint capacity) {
  if (site == kNoSite) return;
  if (!is_final && site != nearest_at(nearest, from).x) return;
  uint max_squared_bits = floatBitsToUint(field.max_squared);
  ivec3 voxel = voxel_of(places, from), away = voxel - voxel_of(places, site);
  vec3 point = site_point(surface_at(surface, site));
  vec3 q = vec3(away) - point;
  float max_offset = max(abs(q.x), max(abs(q.y), abs(q.z)));
  bool near = max_offset < kNear;
  bvec3 both = lessThan(abs(q), vec3(near ? 1e9 : kAside * max_offset));
  ivec3 sign_of = ivec3(q.x < 0.0 ? -1 : 1, q.y < 0.0 ? -1 : 1, q.z < 0.0 ? -1 : 1);
  ivec3 low = ivec3(both.x ? -1 : min(sign_of.x, 0),
                    both.y ? -1 : min(sign_of.y, 0),
                    both.z ? -1 : min(sign_of.z, 0));
  ivec3 size = ivec3(both.x ? 3 : 2, both.y ? 3 : 2, both.z ? 3 : 2);
  int total = size.x * size.y * size.z;
  ivec3 at = ivec3(0);
  uint bits = 0u;
  for (int i = 0; i < total; ++i) {
    ivec3 e = low + at;
    at.z = at.z + 1 == size.z ? 0 : at.z + 1;  // counts through the box: CPU devices divide lane by lane
    at.y = at.z != 0 ? at.y : at.y + 1 == size.y ? 0 : at.y + 1;
    at.x += (at.y | at.z) == 0 ? 1 : 0;
    uint squared = squared_bits(away + e, point), neighbor = address_of(table, voxel + e);
    uvec2 theirs = nearest_at(nearest, neighbor != kNoVoxel ? neighbor : from);
    // Sites at equal distance are offered, too: the neighbor's site may have arrived in this step, and the thread order
    // must not decide between the two.
    bool may_be_nearer = neighbor != kNoVoxel && theirs.x != site && squared <= theirs.y && squared < max_squared_bits;
    bits |= may_be_nearer ? 1u << (9 * e.x + 3 * e.y + e.z + 13) : 0u;
  }
  uint taken = 0u;
  for (; bits != 0u; bits &= bits - 1u) {
    int number = findLSB(bits);
    ivec3 e = step_of(number);
    uint neighbor = address_of(table, voxel + e);
    uint64_t offered = pack64(candidate(away + e, point, site));
    taken |= atomicMin(Nearest(field.nearest).v[neighbor], offered) > offered ? 1u << number : 0u;
  }
  if (taken == 0u) return;
  uint index = append(step + 1u, uint(bitCount(taken)));
  for (; taken != 0u; taken &= taken - 1u, ++index) {
    uint neighbor = address_of(table, voxel + step_of(findLSB(taken)));
    if (index < capacity) next[index] = EsdfEntry(neighbor, site);
    if (fetch(dirty_blocks, int(neighbor >> 12)) == 0u) dirty[neighbor >> 12] = 1u;
  }
}

void main() {
  field = local(push.field);
  uvec2 list_address = push.list;
  uint step = push.step, capacity = push.capacity;
  bool is_final = push.is_final != 0u;
  uint count = min(capacity, Counts(field.counts).v[step].count);
  for (uint i = gl_GlobalInvocationID.x; i < count; i += 64u * gl_NumWorkGroups.x) {
    uvec2 entry = entry_at(list, list_address, i);
    offer(entry.x, entry.y, is_final, step, capacity);
  }
}
