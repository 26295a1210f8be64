// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Computes sites and states from TSDF bricks. In each cell of 2x2x2 TSDF voxels, a plane fitted to the eight distances
// locates the surface. If several cells of a field voxel have a surface, the plane closest to the voxel's center is
// used.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shaders/esdf.h"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { EsdfSitesPush push; };
layout(binding = 0, scalar) readonly buffer Jobs { EsdfJob jobs[]; };
layout(binding = 1, scalar) writeonly buffer List { EsdfEntry list[]; };
layout(binding = 2, scalar) writeonly buffer Dirty { uint dirty[]; };
layout(binding = 3, scalar) buffer Removed { uint removed; };  // number of removed or moved sites
WORDS(4, surface);
WORDS(5, table);
POOL(6);
WORDS(7, free_bits);

EsdfSitesPush parameters;  // without `field`

uint tsdf_word(uint i) { return voxel_in(parameters.voxels, i).x; }

const float kSlack = 1.25;  // hysteresis: factor on the maximum surface distance for an existing site
const float kMargin = 0.02;  // voxels
const float kSteep = 1.5;    // times the slope of a surface seen frontally
const float kNearSurface = 0.7;  // truncations; a cell crossed by the surface has a corner this close

// Words of a cell's corners: 000, 001, 010, 011, and 100 to 111. Free but never observed voxels are kFreeWord, which
// has no weight and defines no surface. 0: unknown.
const uint kFreeWord = 0x7fffu;
struct Corners {
  uvec4 a, b;
};
Corners corners_of(EsdfJob job, ivec3 low) {
  // Free bits, for columns of two corners along z.
  uint bits = 0u, first = job.free * kFreeWords;
  for (int k = 0; k < (job.free != kNoneFree ? 4 : 0); ++k) {
    int x = low.x + (k >> 1), y = low.y + (k & 1);
    bits |= ((fetch(free_bits, int(first) + 2 * x + (y >> 2)) >> (8 * (y & 3) + low.z)) & 3u) << (2 * k);
  }
  uint mask = job.slot != kNoSlot ? 0xffffffffu : 0u, from = ((job.slot & mask) << 9) | uint((low.x << 6) | (low.y << 3) | low.z);
  uvec4 a = uvec4(tsdf_word(from), tsdf_word(from + 1u), tsdf_word(from + 8u), tsdf_word(from + 9u)) & mask;
  uvec4 b = uvec4(tsdf_word(from + 64u), tsdf_word(from + 65u), tsdf_word(from + 72u), tsdf_word(from + 73u)) & mask;
  uvec4 place = uvec4(0u, 1u, 2u, 3u), free_a = ((uvec4(bits) >> place) & 1u) * kFreeWord,
        free_b = ((uvec4(bits) >> (place + 4u)) & 1u) * kFreeWord;
  return Corners(mix(a, free_a, equal(a >> 16, uvec4(0u))), mix(b, free_b, equal(b >> 16, uvec4(0u))));
}
bool all_observed(Corners c) { return all(notEqual(c.a, uvec4(0u))) && all(notEqual(c.b, uvec4(0u))); }

// New word of `surface` for a voxel of the field. `shifts` 2: also evaluates cells shifted by one TSDF voxel.
uint surface_of(EsdfJob job, ivec3 at, uint old, int shifts) {
  int scale_voxels = 1 << parameters.scale_bits, cell_bits = max(0, int(parameters.scale_bits) - 1), cells = 1 << (3 * cell_bits);
  bool is_finest = scale_voxels == 1;
  float scale = float(scale_voxels);
  // In TSDF voxels: the center of the field voxel, and the half size of its part covered by a cell.
  vec3 center = vec3(at) * scale + 0.5 * (scale - 1.0);
  float reach = min(scale, 2.0) * 0.5 * ((old & kHasSurface) != 0u ? kSlack : 1.0);
  float best = 1e9, height = 0.0, sum = 0.0;
  vec3 normal = vec3(0.0, 0.0, 1.0);
  int observed = 0, mask = (1 << cell_bits) - 1;
  uint min_units = min_weight_units(parameters.min_weight);
  for (int i = 0; i < cells * shifts; ++i) {
    bool is_shifted = i >= cells;
    ivec3 cell = ivec3(i >> (2 * cell_bits), (i >> cell_bits) & mask, i & mask);
    ivec3 own = at * scale_voxels + 2 * cell, low = clamp(own - (is_shifted ? 1 : 0), 0, 6);
    Corners c = corners_of(job, low);
    uvec4 lower = min(c.a, c.b);
    uint weight = min(min(lower.x, lower.y), min(lower.z, lower.w)) >> 16;
    vec4 a = vec4(voxel_distance(c.a.x), voxel_distance(c.a.y), voxel_distance(c.a.z), voxel_distance(c.a.w));
    vec4 b = vec4(voxel_distance(c.b.x), voxel_distance(c.b.y), voxel_distance(c.b.z), voxel_distance(c.b.w));
    vec4 s = a + b;
    vec3 gradient = 0.25 * vec3(dot(b - a, vec4(1.0)), s.z + s.w - s.x - s.y, s.y + s.w - s.x - s.z);
    float slope = length(gradient), inverse = 1.0 / max(slope, 1e-6);
    float mean = 0.125 * dot(s, vec4(1.0));
    // Plane distance along the normal: at the center of this cell's part of the voxel, and at the voxel center.
    vec3 middle = vec3(low) + 0.5, part = is_finest ? vec3(at) : vec3(own) + 0.5;
    float at_part = mean + dot(gradient, part - middle), at_center = mean + dot(gradient, center - middle);
    float away = abs(at_center * inverse);
    // A plane may pass outside the corners, in the gap to the next cell. At the finest scale there are no gaps except
    // at brick borders, and depth discontinuities must not be extended.
    vec4 smallest = min(a, b), largest = max(a, b);
    bool is_crossed = min(min(smallest.x, smallest.y), min(smallest.z, smallest.w)) < 0.0 &&
                      max(max(largest.x, largest.y), max(largest.z, largest.w)) >= 0.0;
    bool passes = weight >= min_units && slope > 1e-3 &&
                  (is_crossed || !is_finest || slope <= kSteep * parameters.slope) &&
                  abs(at_part) * inverse <= reach * (abs(gradient.x) + abs(gradient.y) + abs(gradient.z)) * inverse + kMargin;
    bool is_better = passes && away < best;
    best = is_better ? away : best;
    height = is_better ? -at_center * inverse / scale : height;
    normal = is_better ? gradient * inverse : normal;
    bool counts = !is_shifted && all_observed(c);
    sum += counts ? at_part : 0.0;
    observed += counts ? 1 : 0;
  }
  uint state = 2 * observed >= cells ? (sum >= 0.0 ? kOutside : kInside) : kUnknown;
  bool has = best < 1e8 && abs(height) <= 1.0, had = (old & kHasSurface) != 0u;
  uint word = has ? pack_site(height, normal) : 0u;
  vec3 moved = site_point(word) - site_point(old);
  bool stays = had && has && dot(moved, moved) <= parameters.tolerance * parameters.tolerance;
  word = stays ? old & kSiteBits : word;
  bool is_changed = had != has || (had && has && !stays);
  word |= (state << kStateShift) | (is_changed ? kChanged | kQueued : 0u);
  return word;
}

// Conservative test for a surface in a voxel: true if a corner of its cells is near the surface, or unobserved next to
// observed corners. `is_cut`: the surface may pass between its cells and the preceding cells. `state`: as in
// surface_of.
bool may_have_surface(EsdfJob job, ivec3 at, out bool is_cut, out uint state) {
  int scale_voxels = 1 << parameters.scale_bits, cell_bits = max(0, int(parameters.scale_bits) - 1), cells = 1 << (3 * cell_bits);
  int mask = (1 << cell_bits) - 1, sum = 0, observed = 0, min_distance = int(kDistanceUnits);
  is_cut = false;
  for (int i = 0; i < cells; ++i) {
    ivec3 low = min(at * scale_voxels + 2 * ivec3(i >> (2 * cell_bits), (i >> cell_bits) & mask, i & mask), 6);
    Corners c = corners_of(job, low);
    ivec4 a = ivec4(c.a), b = ivec4(c.b);
    ivec4 da = (a << 16) >> 16, db = (b << 16) >> 16, wa = (a >> 16) & 0xffff, wb = (b >> 16) & 0xffff;
    ivec4 both = min(abs(da), abs(db)), total = da + db, lowest = min(wa, wb), highest = max(wa, wb);
    min_distance = min(min_distance, min(min(both.x, both.y), min(both.z, both.w)));
    bool is_observed = min(min(lowest.x, lowest.y), min(lowest.z, lowest.w)) > 0;
    is_cut = is_cut || (!is_observed && max(max(highest.x, highest.y), max(highest.z, highest.w)) > 0);
    bool counts = all_observed(c);
    sum += counts ? total.x + total.y + total.z + total.w : 0;
    observed += counts ? 1 : 0;
  }
  state = 2 * observed >= cells ? (sum >= 0 ? kOutside : kInside) : kUnknown;
  bool is_near = observed > 0 && min_distance < int(kNearSurface * kDistanceUnits);
  return is_cut || is_near;
}

// A thread processes 2^scale_bits columns along z, each as long as a brick: eight voxels in total. Loads dominate the
// cost on a CPU device, and a column has a single brick and block.
struct Column {
  EsdfJob job;
  ivec3 at;      // first voxel, in the brick
  uint address;  // its address; kNoVoxel: no work
};
Column column_of(int column) {
  int bits = 3 - int(parameters.scale_bits), side = 1 << bits;
  int index = (int(group_index()) << (6 + int(parameters.scale_bits))) + (column << 6) + int(gl_LocalInvocationID.x);
  int brick = index >> (2 * bits);
  Column c;
  c.job = jobs[min(brick, int(parameters.jobs) - 1)];
  c.at = ivec3((index >> bits) & (side - 1), index & (side - 1), 0);
  c.address = brick < int(parameters.jobs) ? address_of(table, c.job.brick * side + c.at) : kNoVoxel;
  return c;
}

void main() {
  field = local(push.field);
  parameters.voxels = push.voxels;
  parameters.jobs = push.jobs;
  parameters.scale_bits = push.scale_bits;
  parameters.min_weight = push.min_weight;
  parameters.slope = push.slope;
  parameters.tolerance = push.tolerance;
  parameters.capacity = push.capacity;
  int bits = 3 - int(parameters.scale_bits), side = 1 << bits;
  uint changed = 0u, gone = 0u, closer = 0u, cut = 0u;  // bits by voxel of this thread
  Words surface_words = Words(field.surface);
  for (int column = 0; column < 1 << parameters.scale_bits; ++column) {
    Column c = column_of(column);
    bool is_there = c.address != kNoVoxel, has_voxels = is_there && c.job.slot != kNoSlot;
    for (int z = 0; z < side; ++z) {
      uint bit = 1u << ((column << bits) + z);
      bool is_cut;
      uint old = surface_at(surface, is_there ? c.address + uint(z) : 0u), state;
      bool is_close = may_have_surface(c.job, c.at + ivec3(0, 0, z), is_cut, state) && has_voxels;
      closer |= is_close ? bit : 0u;
      cut |= is_close && is_cut ? bit : 0u;
      bool is_gone = (old & kHasSurface) != 0u;
      uint word = (state << kStateShift) | (is_gone ? kChanged | kQueued : 0u);
      bool is_new = is_there && !is_close && word != old;
      if (is_new) {
        surface_words.v[c.address + uint(z)] = word;
        dirty[c.address >> 12] = 1u;
      }
      changed |= is_new && is_gone ? bit : 0u;
      gone |= is_new && is_gone ? 1u : 0u;
    }
  }
  for (; closer != 0u; closer &= closer - 1u) {
    int i = findLSB(closer);
    Column c = column_of(i >> bits);
    uint z = uint(i & (side - 1)), address = c.address + z, old = surface_at(surface, address);
    // A surface seen at a grazing angle may be between free voxels and a single voxel behind it.
    uint word = surface_of(c.job, c.at + ivec3(0, 0, z), old, (cut >> i & 1u) != 0u ? 2 : 1);
    if (word != old) {
      surface_words.v[address] = word;
      dirty[address >> 12] = 1u;
    }
    changed |= (word & kChanged) != 0u ? 1u << i : 0u;
    gone |= (word & kChanged) != 0u ? old & kHasSurface : 0u;
  }
  if (gone != 0u) removed = 1u;
  for (; changed != 0u; changed &= changed - 1u) {
    int i = findLSB(changed);
    uint address = column_of(i >> bits).address + uint(i & (side - 1)), word = surface_words.v[address];
    uvec2 own = candidate(ivec3(0), site_point(word), address);
    Pairs nearest = Pairs(field.nearest);
    if ((word & kHasSurface) != 0u && is_nearer(own, nearest.v[address])) nearest.v[address] = own;
    uint index = append(0u, 1u);
    if (index < parameters.capacity) list[index] = EsdfEntry(address, kNoSite);
  }
}
