// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>

#include "cairn/sensor_model.hpp"
#include "surface/surface.hpp"
#include "volume/voxel_kernel.hpp"

namespace cairn {

struct Fused {
  int touched = 0;                // bricks that the frame could change
  std::vector<Brick> changed;     // of them those with a new distance, in no order
  int new_bricks = 0;             // without a slot before
  std::vector<Brick> newly_free;  // bricks of which more is known to be free now, sorted
};

/// Allocates the bricks of a frame's truncation band and fuses the frame into all bricks that it sees. The device does
/// it by itself as long as it has vacant slots and the host has none of the bricks. What the frame's rays have passed
/// in front of surfaces is marked as free, and a ball around the camera, since nothing else can be there.
class Integrator {
 public:
  /// `camera_radius`: of that ball, metres.
  Integrator(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, const SensorModel& sensor = {},
             float camera_radius = 0);
  static constexpr std::uint32_t kLookEvery = 8;  // fused frames: neighbouring ones look through nearly the same voxels
  /// `fused_count` counts fused frames from 1. Moves the volume's window to the camera. Every `look_every`-th frame's
  /// rays are followed, the first one's among them.
  Fused integrate(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, Volume& volume,
                  std::uint32_t fused_count, std::uint32_t look_every = kLookEvery);

 private:
  struct Pass;
  [[nodiscard]] Pass pass_over(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                               const Volume& volume, std::uint32_t fused_count, bool looks_through);
  /// Of what a pass saw to be free, and the camera's ball. Returns the bricks of which something is new, sorted.
  [[nodiscard]] std::vector<Brick> mark_free(const Pass& pass, const Eigen::Vector3d& camera, Volume& volume) const;
  void place_missing(gpu::Batch& batch, const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                     const Volume& volume, std::uint32_t fused_count, std::uint32_t vacant);
  void fuse(gpu::Batch& batch, const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
            const Volume& volume, std::uint32_t fused_count, std::uint32_t slots);
  void look_through(gpu::Batch& batch, const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                    const Volume& volume);
  template <class T>
  void read_rest(std::vector<T>& list, std::uint32_t count, const gpu::Buffer& from);

  gpu::Device& device_;
  Camera camera_;
  SurfaceOptions options_;
  double camera_radius_;  // metres
  gpu::Buffer counts_, farthest_, nearest_, least_, vacant_, missing_, selected_, changed_, free_bricks_, part_bricks_,
      free_voxels_;
  std::uint32_t usually_selected_ = 4096, usually_in_part_ = 4096;  // bricks, to download at once
  gpu::Kernel<shader::DepthTilesPush> tiles_;
  gpu::Kernel<shader::BrickMarkPush> mark_;
  gpu::Kernel<shader::BrickPlacePush> place_;
  gpu::Kernel<shader::DepthTilesPush> least_of_;
  gpu::Kernel<shader::BrickFreePush> free_;
  gpu::Kernel<shader::VoxelFreePush> voxels_free_;
  gpu::Kernel<shader::BrickSelectPush> select_;
  VoxelKernel<shader::TsdfIntegratePush> integrate_;
};

}  // namespace cairn
