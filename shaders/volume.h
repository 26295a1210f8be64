// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Volume on the device. A brick is 8x8x8 voxels in OpenVDB's leaf order, z fastest: x * 64 + y * 8 + z. Voxel
// coordinates are integers: voxel (i, j, k) samples the point voxel_size * (i, j, k) of the submap frame; brick (i, j,
// k) starts at voxel 8 (i, j, k). The page table is a dense window of 2^table_bits bricks per side that wraps around:
// the entry of brick b is at b modulo the side. An entry is slot + 1, 0 for a brick never observed, kPending or
// kOnHost.
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
const uint kPending = 0xffffffffu;  // page-table entry of a brick waiting for a slot
const uint kOnHost = 0xfffffffeu;   // page-table entry of a brick on the host
const uint kNoSlot = 0xffffffffu;

struct VolumeView {
  uvec2 voxels;       // device address of the pool: brick slots, each kBrickVoxels uvec2
  ivec3 origin;       // first brick of the window
  uint table_bits;    // the window has 2^table_bits bricks per side
  float voxel_size;   // meters
  float truncation;   // meters
};

struct BrickMarkPush {
  VolumeView volume;
  Pinhole camera;
  Rigid submap_from_camera;
  uint capacity;  // of the list of new bricks
  uint vacant;    // slots available for them
  uint stride;    // pixels; every stride-th pixel of a row and a column is used
  uint phase;     // offset within the stride, changes from frame to frame
};

struct BrickFreePush {
  VolumeView volume;
  Pinhole camera;
  Rigid camera_from_submap;
  ivec3 first;    // first brick of the box to test
  uint size;      // size of the box: x | y << 10 | z << 20; a row of threads is a layer along z
  float min_depth;  // meters
};

struct VoxelFreePush {
  Pinhole camera;
  Rigid camera_from_submap;
  uint bricks;       // capacity of the list
  float voxel_size;  // meters
  float truncation;  // meters
};
const uint kPartsAGroup = 4u;  // bricks per workgroup

struct BrickSelectPush {
  Pinhole camera;
  Rigid submap_from_camera;
  uint slots;         // number of slots to test
  uint capacity;      // of the list of selected bricks
  uint fused_count;         // current frame, for the slots' last_seen
  float brick_size;   // meters
  float truncation;   // meters
  float min_depth;    // meters
};

struct TsdfIntegratePush {
  uvec2 voxels;
  Pinhole camera;
  Rigid camera_from_submap;
  uint has_color;
  float voxel_size;
  float truncation;
  float max_weight;
  uint fused_count;         // current frame
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

// Counters of one pass over a frame; the host initializes them with {0, 1, 1} groups and zeros.
struct FusionCounts {
  Groups placed;     // listed bricks: a workgroup each
  Groups fused;      // selected bricks: folded, see group_index
  Groups carved;  // partly free bricks: a workgroup per kPartsAGroup
  uint missing;      // bricks needed by the frame and not on the device
  uint waiting;      // subset without a slot or on the host: the pass then integrates nothing
  uint selected;
  uint free;          // completely free bricks
  uint free_in_part;  // possibly partly free bricks
};
const uint kMaxGroups = 65535u;  // limit along x guaranteed by all devices

struct Selected {
  uint slot;
  float farthest;  // meters, farthest measurement in the tiles that the brick covers
};

struct SlotState {
  ivec3 brick;
  uint used;       // 1: holds a brick
  uint last_seen;  // fused_count of the last frame that integrated into it
};

// One change of residency: the brick gets a slot with empty voxels (entry = slot + 1), or loses its slot (0 or
// kOnHost).
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

// Contribution of a submap to a world brick: the pose of the brick in the submap, and the submap's bricks there.
struct MergeSource {
  Rigid source_from_target;  // voxels; the source's origin is the first voxel of slots[0], the target's that of its
                             // brick
  uint slots[27];            // x + 3 (y + 3 z); or kEmptySlot, kFreeSlot
};
const uint kEmptySlot = 0u;  // holds unobserved voxels
const uint kFreeSlot = 1u;   // holds voxels that are free but unobserved

struct MergeTarget {
  uint first;  // index of the first source
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
/// Number of tiles of a camera's image.
inline uint tiles(const Camera& camera) {
  return tiles_along(static_cast<uint>(camera.width)) * tiles_along(static_cast<uint>(camera.height));
}
static_assert(sizeof(BrickMarkPush) <= 128 && sizeof(BrickFreePush) <= 128 && sizeof(RaycastPush) <= 128 && sizeof(TsdfIntegratePush) <= 128);
}  // namespace cairn::shader
#else
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Voxels { uvec2 v[]; };

// Tiles possibly covered by a box along the camera axes, with `low` and `high` in x and y, `near` and `far` along z.
struct TileRange {
  uvec2 first;
  uvec2 last;
  bool is_in_view;
  bool is_fully_in_view;  // completely in view
};
TileRange tiles_of_box(Pinhole camera, vec2 low, vec2 high, float near, float far) {
  vec2 f = vec2(camera.fx, camera.fy), c = vec2(camera.cx, camera.cy);
  vec2 from = f * low / mix(vec2(far), vec2(near), lessThan(low, vec2(0.0))) + c;
  vec2 to = f * high / mix(vec2(near), vec2(far), lessThan(high, vec2(0.0))) + c;
  vec2 size = vec2(camera.width, camera.height);
  bool is_outside = any(lessThan(to, vec2(0.0))) || any(greaterThanEqual(from, size));
  bool is_fully_in_view = all(greaterThanEqual(from, vec2(0.0))) && all(lessThan(to, size));
  return TileRange(uvec2(max(from, vec2(0.0))) / kTile, uvec2(min(to, size - 1.0)) / kTile, !is_outside,
                   is_fully_in_view);
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
// Slot of a page-table entry.
uint slot_of_entry(uint entry) { return entry >= kOnHost ? kNoSlot : entry - 1u; }
uint voxel_index(uint slot, ivec3 voxel) {
  uvec3 v = uvec3(voxel) & 7u;
  return (slot << 9) | (v.x << 6) | (v.y << 3) | v.z;
}
#endif

#endif
