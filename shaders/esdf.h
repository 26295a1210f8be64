// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The distance field on the device. A block is 16x16x16 voxels; voxel (x, y, z) of slot s has the address
// s << 12 | x << 8 | y << 4 | z. A page table finds the slot of a block; it wraps around, so that the map may lie
// anywhere as long as it is smaller than the table. Every voxel holds
//   nearest   the voxel whose site is the nearest one: squared distance (float bits) << 32 | address
//   surface   its own site, if the surface passes it, and what is known about it; see kHasSurface and below
// At a site the surface is a plane, perpendicular to the normal and at height * normal from the voxel's centre. Lengths
// in voxels.
#ifndef CAIRN_ESDF_H
#define CAIRN_ESDF_H
#include "shaders/volume.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kEsdfSide = 16;       // voxels
const uint kEsdfVoxels = 4096;   // a block
// A block to check is its slot << kBlockFlags, with what is asked of it.
const uint kBlockIsNew = 1u;
const uint kBlockRestart = 2u;
const uint kBlockFlags = 2;
const uint kEsdfReach = 512;     // blocks from the world's origin

const uint kSiteBits = 0x0fffffffu;  // height and normal of its own site, with
const uint kHasSurface = 1u << 27;
const uint kChanged = 1u << 28;  // its site came, went or moved in this update
const uint kQueued = 1u << 29;   // it waits in the list
const uint kStateShift = 30;     // two bits:
const uint kUnknown = 0;
const uint kOutside = 1;
const uint kInside = 2;

struct EsdfView {
  uvec2 nearest;      // device addresses, by voxel
  uvec2 surface;
  uvec2 blocks;       // packed block coordinates by slot
  uvec2 table;        // slot + 1 by block, or 0
  uvec2 counts;       // EsdfCount by step of the wave
  uint table_bits;    // the table has 2^table_bits blocks a side
  float max_squared;  // no voxel looks farther
  uint max_groups;    // of one dispatch
};

// A list of voxels and the dispatch that works on it: 64 of them a group, and several times where it is longer than a
// dispatch may be.
struct EsdfCount {
  uint groups;
  uint one_y;
  uint one_z;
  uint count;
};

struct EsdfEntry {
  uint voxel;  // address
  uint site;   // what it was offered in the step before; kNoSite: nothing, or not the nearest
};

const uint kNoSite = 0xffffffffu;

// A brick of the TSDF whose voxels changed.
struct EsdfJob {
  ivec3 brick;
  uint slot;   // of its voxels; kNoSlot: it has none
  uint free;   // which of the lists of bits tells what was seen to be free; a list is kFreeWords words
};
const uint kNoneFree = 0;
const uint kAllFree = 1;
const uint kFreeWords = 16;

struct EsdfSitesPush {
  EsdfView field;
  uvec2 voxels;         // the TSDF's
  uint jobs;            // a workgroup does 512 voxels of the field
  uint scale_bits;      // 2^scale_bits TSDF voxels a voxel of the field: 1, 2, 4 or 8
  float min_weight;     // of TSDF voxels that make surface
  float slope;          // of the TSDF at a surface: truncations a TSDF voxel
  float tolerance;      // sites that moved less stay where they are
  uint capacity;        // of the list
};

struct EsdfCheckPush {
  EsdfView field;
  uint capacity;  // of the list
  uint blocks;
};

struct EsdfWavePush {
  EsdfView field;
  uvec2 list;         // device address of the list it works on
  uint step;        // of the counts: works on list `step`, appends to list `step + 1`
  uint capacity;    // of a list
  uint is_settled;  // esdf_settle came before
};

// A box of cells, one a voxel, with z fastest.
struct EsdfBoxPush {
  EsdfView field;
  ivec3 first;  // voxel
  ivec3 size;
  ivec3 low;    // voxels from here on, up to `high`, take what was found
  ivec3 high;
  uint blocks;
  uint capacity;  // of the list
};

struct EsdfLinesPush {
  EsdfView field;
  ivec3 first;  // of the box
  ivec3 size;
  uint axis;    // of the lines
  uint row;     // the lines of `rows` layers across x; across y for those along x
  uint rows;
};

// A site as its line sees it.
struct Parabola {
  uint site;    // address
  float start;  // of the part of the line to which it is the nearest; -1 of the first
  float at;     // on the line, voxels
  float over;   // squared distance from the line
};

struct EsdfDistancePush {
  EsdfView field;
  float voxel_size;    // metres
  float max_distance;  // metres
  uint blocks;
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
// A CPU device computes both sides of every `if` for all lanes. What few voxels need is therefore done in two loops: the
// first one marks in bits what is to be done, the second one runs over these bits.
// What is read at places that each thread computes comes as texels (shaders/fetch.h), or by address where the field has
// more voxels than the device has texels. Of what a kernel also writes a texel may be as it was when the kernel began.
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#include "shaders/pool.h"
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Nearest { uint64_t v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Pairs { uvec2 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint v[]; };
layout(constant_id = 0) const float kFieldInTexels = 1.0;

EsdfView field;  // main() fills it with local(push.field)
EsdfView local(EsdfView f) {  // see types.h
  return EsdfView(f.nearest, f.surface, f.blocks, f.table, f.counts, f.table_bits, f.max_squared, f.max_groups);
}
uvec2 nearest_at(utextureBuffer nearest, uint address) {  // (site, squared distance)
  return kFieldInTexels > 0.0 ? fetch(nearest, int(address)) : Pairs(field.nearest).v[address];
}
uvec2 entry_at(utextureBuffer list, uvec2 address, uint i) {  // as EsdfEntry
  return kFieldInTexels > 0.0 ? fetch(list, int(i)) : Pairs(address).v[i];
}
uint surface_at(itextureBuffer surface, uint address) {
  return kFieldInTexels > 0.0 ? fetch(surface, int(address)) : Words(field.surface).v[address];
}

const uint kNoVoxel = 0xffffffffu;
// Of a voxel that knows no site: both words. Lists and addresses say kNoVoxel.
bool is_far(uvec2 nearest) { return nearest.x == kNoVoxel; }

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Counts { EsdfCount v[]; };

bool is_in_box(ivec3 cell, ivec3 size) { return all(greaterThanEqual(cell, ivec3(0))) && all(lessThan(cell, size)); }
uint cell_index(ivec3 cell, ivec3 size) { return uint((cell.x * size.y + cell.y) * size.z + cell.z); }
ivec3 face_of(int i) { int s = 1 - 2 * (i & 1), a = i >> 1; return ivec3(a == 0 ? s : 0, a == 1 ? s : 0, a == 2 ? s : 0); }

// Places in the list of a step; returns the first.
uint append(uint step, uint places) {
  Counts counts = Counts(field.counts);
  uint first = atomicAdd(counts.v[step].count, places);
  uint groups = min((first + places + 63u) >> 6, field.max_groups) - min((first + 63u) >> 6, field.max_groups);
  if (groups != 0u) atomicAdd(counts.v[step].groups, groups);
  return first;
}

ivec3 voxel_of(itextureBuffer blocks, uint address) {
  uint b = kFieldInTexels > 0.0 ? fetch(blocks, int(address >> 12)) : Words(field.blocks).v[address >> 12];
  ivec3 block = ivec3(b & 1023u, (b >> 10) & 1023u, b >> 20) - int(kEsdfReach);
  return block * 16 + ivec3((address >> 8) & 15u, (address >> 4) & 15u, address & 15u);
}
uint address_of(itextureBuffer table, ivec3 voxel) {
  uvec3 b = uvec3(voxel >> 4) & ((1u << field.table_bits) - 1u), v = uvec3(voxel) & 15u;
  uint at = (((b.z << field.table_bits) | b.y) << field.table_bits) | b.x;
  uint entry = kFieldInTexels > 0.0 ? fetch(table, int(at)) : Words(field.table).v[at];
  return entry == 0u ? kNoVoxel : ((entry - 1u) << 12) | (v.x << 8) | (v.y << 4) | v.z;
}

// Sites: height in 9 bits, normal in 18 (octahedral, as pack_normal).
const float kHeightUnits = 255.0;  // a voxel
uint pack_site(float height, vec3 n) {
  n /= abs(n.x) + abs(n.y) + abs(n.z);
  vec2 e = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  ivec2 code = ivec2((e * 0.5 + 0.5) * 511.0 + 0.5);
  int h = int(clamp(height, -1.0, 1.0) * kHeightUnits + 256.5);
  return uint(h | (code.x << 9) | (code.y << 18)) | kHasSurface;
}
vec3 site_normal(uint word) {
  vec2 e = vec2(ivec2((word >> 9) & 511u, (word >> 18) & 511u)) * (2.0 / 511.0) - 1.0;
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  float t = max(-n.z, 0.0);
  n.xy += vec2(n.x >= 0.0 ? -t : t, n.y >= 0.0 ? -t : t);
  return normalize(n);
}
float site_height(uint word) { return float(int(word & 511u) - 256) * (1.0 / kHeightUnits); }
vec3 site_point(uint word) { return site_height(word) * site_normal(word); }  // from its voxel's centre

// The steps to a voxel's neighbours, and to itself, numbered by 9 x + 3 y + z from (-1, -1, -1).
ivec3 step_of(int number) {
  int x = (number * 57) >> 9, r = number - 9 * x, y = (r * 11) >> 5;  // divisions by 9 and 3
  return ivec3(x, y, r - 3 * y) - 1;
}

// Of a voxel that lies `away` from the site's voxel: the same bits wherever it is asked for, since which of two sites
// is nearer must not depend on who asks. Of sites equally far the one at the lower address counts as the nearer.
uint squared_bits(ivec3 away, vec3 point) {
  precise vec3 q = vec3(away) - point;
  precise float squared = q.x * q.x + q.y * q.y + q.z * q.z;
  return floatBitsToUint(squared);
}
uvec2 candidate(ivec3 away, vec3 point, uint site) { return uvec2(site, squared_bits(away, point)); }
// Of two that a voxel may know: 64 bits with the distance above, as atomicMin compares them.
bool is_nearer(uvec2 a, uvec2 b) { return a.y < b.y || (a.y == b.y && a.x < b.x); }
#endif
#endif
