// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "cairn/mapping/gravity_alignment.hpp"
#include "cairn/mapping/sensor_model.hpp"

namespace cairn {

/// Effort after the last frame.
enum class Quality {
  fast,  ///< the map as tracked
  good,  ///< bundle adjustment and re-integration, kept if held-out frames confirm them
  best   ///< the same, with every frame tracked again
};

/// Name of the enumerator.
[[nodiscard]] std::string_view to_string(Quality quality);

struct SurfaceOptions {
  float min_depth = 0.3f;            ///< meters; nearer measurements are dropped
  float max_depth = 5.0f;            ///< meters; farther measurements are dropped
  float filter_sigma_pixels = 1.5f;  ///< pixels; spatial width of the bilateral filter
  float filter_range = 6.0f;         ///< bilateral filter: neighbors farther than this many noise sigmas are ignored
  float edge_slope = 6.0f;           ///< noise sigmas; a pixel that differs by more from its neighbors on both sides of
                                     ///< a depth jump is dropped as a flying pixel
};

/// Use of Frame::guess, the poses of the device's own tracking.
enum class DevicePoses {
  off,    ///< not used
  guess,  ///< initial guess of the alignment
  prior   ///< measurement of the motion in tracking, pose graph and adjustment, with a drift estimated by comparison
};

/// Name of the enumerator.
[[nodiscard]] std::string_view to_string(DevicePoses use);
/// Throws std::runtime_error with the valid names for an unknown name.
[[nodiscard]] DevicePoses device_poses_of(std::string_view name);

struct TrackOptions {
  int levels = 3;                  ///< pyramid levels, each half the size of the previous
  int finest_level = 1;            ///< 0: full resolution, four times the work for 2 % less error
  int iterations_finest = 10;      ///< upper limit on the finest level
  int iterations_coarse = 12;      ///< upper limit per coarser level
  float max_distance = 0.1f;       ///< meters between matched points at the finest level
  float max_angle = 0.5236f;       ///< radians between matched normals
  bool photometric = true;         ///< also align brightness if color is available
  float huber = 1.5f;              ///< in standard deviations of the depth noise (Huber 1964)
  float min_inlier_share = 0.25f;  ///< fraction of inliers among the pixels that see the model; fewer: lost
  float max_rmse = 4.0f;           ///< in standard deviations of the depth noise; more: lost
  DevicePoses device_poses = DevicePoses::prior;  ///< use of Frame::guess
};

struct FuseOptions {
  float voxel_size = 0.01f;         ///< meters
  float truncation = 0.04f;         ///< meters, on each side of the surface
  float max_weight = 64.0f;         ///< observations at 1 m; lower forgets sooner
  float min_mesh_weight = 0.1f;     ///< minimum voxel weight for meshing: one observation at 3 m, three at 5 m
  std::uint64_t device_memory = 0;  ///< bytes for bricks; 0: half of the device memory, at most 2 GiB
};

struct MapOptions {
  float submap_radius = 3.0f;     ///< meters from a submap's first camera position; a camera farther away ends the
                                  ///< submap
  int submap_bricks = 65536;      ///< number of bricks that ends a submap
  int submap_keyframes = 200;     ///< number of keyframes that ends a submap: limits the drift inside it
  bool loops = true;              ///< detect loop closures and correct the map
  int lost_frames = 45;           ///< consecutive lost frames before a new component starts
  std::uint64_t host_memory = 0;  ///< bytes for ended submaps, the rest is paged to disk; 0: 16 MiB
};

struct EsdfOptions {
  bool live = false;          ///< keeps the distance field up to date while frames are fused
  float voxel_size = 0.0f;    ///< meters: 1, 2, 4 or 8 voxels of the TSDF; 0: two
  float max_distance = 2.0f;  ///< meters; larger distances are clamped
  float robot_radius = 0.1f;  ///< meters around each camera position marked as free, because the carrier was there; at
                              ///< least 1.75 voxels of the distance field; 0: off
};

/// Speed limits of the camera. A pose that exceeds them relative to the previous pose is rejected.
struct MotionOptions {
  float max_speed = 4.0f;  ///< m/s; a hand is slower
  float max_turn = 12.0f;  ///< rad/s
};

struct Options {
  bool keep_keyframes = false;  ///< also with given poses, for textures; always kept with tracked poses
  /// Up direction of exported maps; none: Up::automatic, or the unrotated world of given poses. Stored in a session.
  std::optional<Up> up;
  SurfaceOptions surface;
  TrackOptions track;
  MotionOptions motion;
  FuseOptions fuse;
  MapOptions map;
  EsdfOptions esdf;
};

/// Options for a sensor: its depth range, and a truncation of four voxels or, if larger, two and a half standard
/// deviations of its depth at 2 m.
[[nodiscard]] Options options_for(const SensorModel& sensor, float voxel_size = FuseOptions{}.voxel_size);

/// Limits for `hand`, `robot`, `drone` or `unknown` (timestamps at an assumed rate: practically none); throws
/// std::runtime_error for another name.
[[nodiscard]] MotionOptions motion_of(std::string_view name);

/// Overrides `options` with a YAML file of the form `surface: {max_depth: 4}`. Throws std::runtime_error with file and
/// line for an unknown key or an invalid value.
void read_options(const std::filesystem::path& file, Options& options);

/// Throws std::runtime_error naming the option, its value and the allowed range.
void check(const Options& options);

}  // namespace cairn
