// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "cairn/sensor_model.hpp"
#include "cairn/upright.hpp"

namespace cairn {

struct SurfaceOptions {
  float min_depth = 0.3f;            ///< metres; nearer measurements are dropped
  float max_depth = 5.0f;            ///< metres; farther measurements are dropped
  float filter_sigma_pixels = 1.5f;  ///< pixels; the width of the bilateral filter
  float filter_range = 6.0f;         ///< bilateral filter: neighbours farther than this many noise sigmas do not count
  float edge_slope = 6.0f;           ///< a pixel whose neighbours differ by more than this many noise sigmas on both
                                     ///< sides of a jump is flying and is dropped
};

struct TrackOptions {
  int levels = 3;                  ///< pyramid levels, each half the size of the one before
  int finest_level = 1;            ///< 0: full resolution, four times the work for 2 % less error
  int iterations_finest = 10;      ///< at most, on the finest level
  int iterations_coarse = 12;      ///< at most, per level
  float max_distance = 0.1f;       ///< metres between matched points at the finest level
  float max_angle = 0.5236f;       ///< radians between matched normals
  bool photometric = true;         ///< align brightness too, where there is colour
  float huber = 1.5f;              ///< in standard deviations of the depth noise (Huber 1964)
  float min_inlier_share = 0.25f;  ///< of the pixels that see the model; fewer means lost
  float max_rmse = 4.0f;           ///< in standard deviations of the depth noise; more means lost
};

struct FuseOptions {
  float voxel_size = 0.01f;         ///< metres
  float truncation = 0.04f;         ///< metres, on each side of the surface
  float max_weight = 64.0f;         ///< observations at 1 m; lower forgets sooner
  float min_mesh_weight = 0.1f;     ///< voxels below it make no surface: one observation at 3 m, three at 5 m
  std::uint64_t device_memory = 0;  ///< bytes for bricks; 0: half of what the device has, 2 GiB at most
};

struct MapOptions {
  float submap_radius = 3.0f;     ///< metres from where a submap began; a camera that is farther away ends it
  int submap_bricks = 65536;      ///< that end a submap
  int submap_keyframes = 200;     ///< that end a submap: what tracking drifts over them stays in it
  bool loops = true;              ///< recognise places and correct the map
  int lost_frames = 45;           ///< in a row, after which the camera begins a new piece of the map
  std::uint64_t host_memory = 0;  ///< bytes for ended submaps, others wait on the disk; 0: 16 MiB
};

struct EsdfOptions {
  bool live = false;          ///< true keeps the distance field up to date while frames are fused
  float voxel_size = 0.0f;    ///< metres: 1, 2, 4 or 8 voxels of the TSDF; 0: two
  float max_distance = 2.0f;  ///< metres; of places farther from every surface only that is known
  float robot_radius = 0.1f;  ///< metres around the camera that are free wherever it was: who carried it was there; of
                              ///< the distance field at least 1.75 voxels; 0: not even these
};

/// How fast the camera may move. A pose farther from the one before is not believed.
struct MotionOptions {
  float max_speed = 4.0f;  ///< m/s; a hand is slower
  float max_turn = 12.0f;  ///< rad/s
};

struct Options {
  bool keep_keyframes = false;  ///< also with given poses, for textures; with tracked ones they are kept anyway
  /// What points up where the map is written; none: Up::automatic, or the world of given poses as it is. A session
  /// remembers it.
  std::optional<Up> up;
  SurfaceOptions surface;
  TrackOptions track;
  MotionOptions motion;
  FuseOptions fuse;
  MapOptions map;
  EsdfOptions esdf;
};

/// The options that suit a sensor: its range of depth, and a truncation of four voxels or, if that is more, of two and
/// a half standard deviations of its depth at 2 m.
[[nodiscard]] Options options_for(const SensorModel& sensor, float voxel_size = FuseOptions{}.voxel_size);

/// `hand`, `robot` or `drone`; throws std::runtime_error for another name.
[[nodiscard]] MotionOptions motion_of(std::string_view name);

/// Overrides `options` with a YAML file of the shape `surface: {max_depth: 4}`. Throws std::runtime_error with file and
/// line for an unknown key or a value that does not fit.
void read_options(const std::filesystem::path& file, Options& options);

/// Throws std::runtime_error naming the option, its value and the allowed range.
void check(const Options& options);

}  // namespace cairn
