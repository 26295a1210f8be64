// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Distance field on the device. A block is 16x16x16 voxels; voxel (x, y, z) of slot s has the address s << 12 | x << 8
// | y << 4 | z. A page table maps blocks to slots; it wraps around, so the map may be anywhere as long as it is smaller
// than the table. Each voxel stores
//   nearest   address of the nearest site's voxel: squared distance (float bits) << 32 | address
//   surface   its own site, if the surface crosses the voxel, and its state; see kHasSurface and below
// At a site the surface is a plane, perpendicular to the normal, at height * normal from the voxel center. Lengths are
// in voxels.
#ifndef CAIRN_ESDF_H
#define CAIRN_ESDF_H
#include "shaders/volume.h"
#ifdef __cplusplus
namespace cairn::shader {
#endif

const uint kEsdfSide = 16;       // voxels
const uint kEsdfVoxels = 4096;   // per block
// A block to check is encoded as slot << kBlockFlags | flags.
const uint kBlockIsNew = 1u;
const uint kBlockRestart = 2u;
const uint kBlockFlags = 2;
const uint kEsdfReach = 512;     // blocks from the world origin

const uint kSiteBits = 0x0fffffffu;  // height and normal of the voxel's own site, including
const uint kHasSurface = 1u << 27;
const uint kChanged = 1u << 28;  // its site was added, removed or moved in this update
const uint kQueued = 1u << 29;   // in the current list
const uint kStateShift = 30;     // two bits:
const uint kUnknown = 0;
const uint kOutside = 1;
const uint kInside = 2;

struct EsdfView {
  uvec2 nearest;      // device addresses; by voxel
  uvec2 surface;
  uvec2 blocks;       // packed block coordinates by slot
  uvec2 table;        // slot + 1 by block, or 0
  uvec2 counts;       // EsdfCount by wave step
  uint table_bits;    // the table has 2^table_bits blocks per side
  float max_squared;  // squared maximum distance
  uint max_groups;    // per dispatch
};

// Size of a voxel list and its dispatch: 64 voxels per group; each group loops if the list exceeds the largest
// dispatch.
struct EsdfCount {
  uint groups;
  uint one_y;
  uint one_z;
  uint count;
};

struct EsdfEntry {
  uint voxel;  // address
  uint site;   // site offered in the previous step; kNoSite: none, or not the nearest
};

const uint kNoSite = 0xffffffffu;

// A TSDF brick with changed voxels.
struct EsdfJob {
  ivec3 brick;
  uint slot;   // slot of its voxels; kNoSlot: no voxels
  uint free;   // index of its list of free bits; a list has kFreeWords words
};
const uint kNoneFree = 0;
const uint kAllFree = 1;
const uint kFreeWords = 16;

struct EsdfSitesPush {
  EsdfView field;
  uvec2 voxels;         // TSDF voxels
  uint jobs;            // bricks; a workgroup processes 512 field voxels
  uint scale_bits;      // 2^scale_bits TSDF voxels per field voxel: 1, 2, 4 or 8
  float min_weight;     // minimum weight of TSDF voxels that define a surface
  float slope;          // slope of the TSDF at a surface: truncations per TSDF voxel
  float tolerance;      // sites that moved less keep their position
  uint capacity;        // of the list
};

struct EsdfCheckPush {
  EsdfView field;
  uint capacity;  // of the list
  uint blocks;
};

struct EsdfWavePush {
  EsdfView field;
  uvec2 list;         // device address of the input list
  uint step;        // reads list `step`, appends to list `step + 1`
  uint capacity;    // of a list
  uint is_final;  // true after esdf_finalize
};

// Box of cells, one per voxel, z fastest.
struct EsdfBoxPush {
  EsdfView field;
  ivec3 first;  // voxel
  ivec3 size;
  ivec3 low;    // output range of voxels, from `low` to `high` (exclusive)
  ivec3 high;
  uint blocks;
  uint capacity;  // of the list
};

struct EsdfLinesPush {
  EsdfView field;
  ivec3 first;  // first voxel of the box
  ivec3 size;
  uint axis;    // direction of the lines
  uint row;     // the lines of `rows` layers across x; across y for lines along x
  uint rows;
};

// A site relative to a line.
struct Parabola {
  uint site;    // address
  float start;  // start of the line segment closest to this site; -1 for the first site
  float at;     // coordinate along the line, voxels
  float over;   // squared distance from the line
};

struct EsdfDistancePush {
  EsdfView field;
  float voxel_size;    // meters
  float max_distance;  // meters
  uint blocks;
};

#ifdef __cplusplus
}  // namespace cairn::shader
#else
// A CPU device evaluates both sides of each `if` for all lanes. Rare work is therefore done in two loops: the first
// sets bits for the work, the second iterates over the set bits.
// Data with per-thread addresses is read as texels (shaders/fetch.h), or by address if the field exceeds the texel
// limit of the device. A texel of a buffer that the kernel also writes may have its value from the kernel's start.
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
#include "shaders/pool.h"
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Nearest { uint64_t v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Pairs { uvec2 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint v[]; };
layout(constant_id = 0) const float kFieldInTexels = 1.0;

EsdfView field;  // set by main() to local(push.field)
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
// True for a voxel without a site: both words are kNoVoxel. Lists and addresses also use kNoVoxel.
bool is_far(uvec2 nearest) { return nearest.x == kNoVoxel; }

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Counts { EsdfCount v[]; };

bool is_in_box(ivec3 cell, ivec3 size) { return all(greaterThanEqual(cell, ivec3(0))) && all(lessThan(cell, size)); }
uint cell_index(ivec3 cell, ivec3 size) { return uint((cell.x * size.y + cell.y) * size.z + cell.z); }
ivec3 face_of(int i) { int s = 1 - 2 * (i & 1), a = i >> 1; return ivec3(a == 0 ? s : 0, a == 1 ? s : 0, a == 2 ? s : 0); }

// Reserves places in the list of a step; returns the first.
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

// Site encoding: height in 9 bits, normal in 18 (octahedral, like pack_normal).
const float kHeightUnits = 255.0;  // per voxel
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
vec3 site_point(uint word) { return site_height(word) * site_normal(word); }  // relative to the center of its voxel

// Offset to neighbor `number` = 9 x + 3 y + z from (-1, -1, -1), including the voxel itself.
ivec3 step_of(int number) {
  int x = (number * 57) >> 9, r = number - 9 * x, y = (r * 11) >> 5;  // divisions by 9 and 3
  return ivec3(x, y, r - 3 * y) - 1;
}

// Squared distance between a voxel at `away` from the site's voxel and the site. `precise`: equal bits in every kernel,
// since the order of two sites must not depend on the caller. At equal distances, the site with the lower address is
// the nearer.
uint squared_bits(ivec3 away, vec3 point) {
  precise vec3 q = vec3(away) - point;
  precise float squared = q.x * q.x + q.y * q.y + q.z * q.z;
  return floatBitsToUint(squared);
}
uvec2 candidate(ivec3 away, vec3 point, uint site) { return uvec2(site, squared_bits(away, point)); }
// Compares two candidates as atomicMin does: 64 bits, with the distance in the upper half.
bool is_nearer(uvec2 a, uvec2 b) { return a.y < b.y || (a.y == b.y && a.x < b.x); }
#endif
#endif
