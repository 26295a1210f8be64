// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The volume on the device. A brick is 8x8x8 voxels with OpenVDB's leaf order, z fastest: x * 64 + y * 8 + z. Voxel
// coordinates are integers, voxel (i, j, k) samples the point voxel_size * (i, j, k) of the submap frame; brick (i, j, k)
// starts at voxel 8 (i, j, k). The page table is a dense window of 2^table_bits bricks a side that wraps around: brick b
// lies at b mod its side. An entry is slot + 1, 0 for a brick that nobody has seen, kPending or kOnHost.
#ifndef CAIRN_VOLUME_H
#define CAIRN_VOLUME_H
#ifdef __cplusplus
#include "shaders/voxel.h"
namespace cairn::shader {
#else
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#include "shaders/voxel.h"
#endif

const uint kBrickVoxels = 512;
const uint kPending = 0xffffffffu;  // page-table entry of a brick that waits for a slot
const uint kOnHost = 0xfffffffeu;   // of one whose voxels are on the host
const uint kNoSlot = 0xffffffffu;

struct VolumeView {
  uvec2 voxels;       // device address of the pool: brick slots, each kBrickVoxels uvec2
  ivec3 origin;       // first brick of the window
  uint table_bits;    // the window has 2^table_bits bricks a side
  float voxel_size;   // metres
  float truncation;   // metres
};

struct BrickMarkPush {
  VolumeView volume;
  Pinhole camera;
  Rigid submap_from_camera;
  uint capacity;  // of the list of new bricks
  uint vacant;    // slots to give to them
  uint stride;    // pixels; every stride-th of a row and a column is looked at
  uint phase;     // which of them: changes from frame to frame
};

struct BrickFreePush {
  VolumeView volume;
  Pinhole camera;
  Rigid camera_from_submap;
  ivec3 first;    // of the bricks to look at
  uint size;      // of their box: x | y << 10 | z << 20; a row of threads is one layer along z
  float min_depth;  // metres
};

struct VoxelFreePush {
  Pinhole camera;
  Rigid camera_from_submap;
  uint bricks;       // that the list holds at most
  float voxel_size;  // metres
  float truncation;  // metres
};
const uint kPartsAGroup = 4u;  // bricks a workgroup

struct BrickSelectPush {
  Pinhole camera;
  Rigid submap_from_camera;
  uint slots;         // slots to look at
  uint capacity;      // of the list of selected bricks
  uint fused_count;         // the frame, for the slots' last use
  float brick_size;   // metres
  float truncation;   // metres
  float min_depth;    // metres
};

struct TsdfIntegratePush {
  uvec2 voxels;
  Pinhole camera;
  Rigid camera_from_submap;
  uint has_colour;
  float voxel_size;
  float truncation;
  float max_weight;
  uint fused_count;         // the frame
};

struct DepthTilesPush {
  uint width;
  uint height;
};

struct RaycastRangePush {
  Pinhole camera;
  Rigid submap_from_camera;
  uint slots;
  float brick_size;
  float min_depth;
  float max_depth;
};

struct RaycastPush {
  VolumeView volume;
  Pinhole camera;
  Rigid submap_from_camera;
};

// Of one pass over a frame; the host begins it with {0, 1, 1} groups and zeros.
struct FusionCounts {
  Groups placed;     // bricks that are listed: a workgroup for each
  Groups fused;      // bricks that are selected: folded, see group_index
  Groups looked_at;  // bricks that are free in part: a workgroup for kPartsAGroup
  uint missing;      // bricks that the frame needs and that were not on the device
  uint waiting;      // of them those that found no slot, or that the host has: the pass then fuses nothing
  uint selected;
  uint free;          // bricks that turned out to be free as a whole
  uint free_in_part;  // bricks that may be so in part
};
const uint kMostGroups = 65535u;  // along x, that all devices take

struct Selected {
  uint slot;
  float farthest;  // metres, of what the depth image sees in front of or in the brick
};

struct SlotState {
  ivec3 brick;
  uint used;       // 1: holds a brick
  uint last_seen;  // fused_count of the last frame that integrated into it
};

// One change of residency: the brick gets a slot and empty voxels (entry = slot + 1), or loses it (0 or kOnHost).
struct Placement {
  ivec3 brick;
  uint slot;
  uint table_index;
  uint entry;
};

struct BrickPlacePush {
  uvec2 voxels;
  uint count;
  uint fused_count;
};

// One submap's share of a brick of the world: where the brick's voxels lie in the submap, and the submap's bricks there.
struct MergeSource {
  Rigid source_from_target;  // voxels; the source's origin is the first voxel of slots[0], the target's that of its brick
  uint slots[27];            // x + 3 (y + 3 z); or kEmptySlot, kFreeSlot
};
const uint kEmptySlot = 0u;  // holds voxels that nobody observed
const uint kFreeSlot = 1u;   // holds voxels that were seen to be free and nothing more

struct MergeTarget {
  uint first;  // of the list of sources
  uint count;
};

struct SubmapMergePush {
  uvec2 voxels;      // of the sources, by slot
  float max_weight;  // observations
  uint targets;
};

const uint kTile = 8;  // pixels; side of the tiles of depth and range images
constexpr uint tiles_along(uint pixels) { return (pixels + kTile - 1u) / kTile; }

#ifdef __cplusplus
/// Tiles of a camera's image.
inline uint tiles(const Camera& camera) {
  return tiles_along(static_cast<uint>(camera.width)) * tiles_along(static_cast<uint>(camera.height));
}
static_assert(sizeof(BrickMarkPush) <= 128 && sizeof(BrickFreePush) <= 128 && sizeof(RaycastPush) <= 128 && sizeof(TsdfIntegratePush) <= 128);
}  // namespace cairn::shader
#else
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Voxels { uvec2 v[]; };

// The tiles that a box along the camera's axes may cover, `low` and `high` in x and y, `near` and `far` along z.
struct TileRange {
  uvec2 first;
  uvec2 last;
  bool is_in_view;
  bool is_whole;  // all of it is in view
};
TileRange tiles_of_box(Pinhole camera, vec2 low, vec2 high, float near, float far) {
  vec2 f = vec2(camera.fx, camera.fy), c = vec2(camera.cx, camera.cy);
  vec2 from = f * low / mix(vec2(far), vec2(near), lessThan(low, vec2(0.0))) + c;
  vec2 to = f * high / mix(vec2(near), vec2(far), lessThan(high, vec2(0.0))) + c;
  vec2 size = vec2(camera.width, camera.height);
  bool is_outside = any(lessThan(to, vec2(0.0))) || any(greaterThanEqual(from, size));
  bool is_whole = all(greaterThanEqual(from, vec2(0.0))) && all(lessThan(to, size));
  return TileRange(uvec2(max(from, vec2(0.0))) / kTile, uvec2(min(to, size - 1.0)) / kTile, !is_outside, is_whole);
}

VolumeView local(VolumeView v) {  // see types.h
  return VolumeView(v.voxels, v.origin, v.table_bits, v.voxel_size, v.truncation);
}
bool in_window(VolumeView volume, ivec3 brick) {
  return all(lessThan(uvec3(brick - volume.origin), uvec3(1u << volume.table_bits)));
}
uint table_index(VolumeView volume, ivec3 brick) {
  uvec3 b = uvec3(brick) & ((1u << volume.table_bits) - 1u);
  return (((b.z << volume.table_bits) | b.y) << volume.table_bits) | b.x;
}
// The slot behind a page-table entry.
uint slot_of_entry(uint entry) { return entry >= kOnHost ? kNoSlot : entry - 1u; }
uint voxel_index(uint slot, ivec3 voxel) {
  uvec3 v = uvec3(voxel) & 7u;
  return (slot << 9) | (v.x << 6) | (v.y << 3) | v.z;
}
#endif

#endif
