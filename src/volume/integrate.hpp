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
  std::vector<Brick> newly_free;  // bricks without voxels that the frame looked through, for the first time
};

/// Allocates the bricks of a frame's truncation band and fuses the frame into all bricks that it sees.
class Integrator {
 public:
  Integrator(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, const SensorModel& sensor = {});
  /// `fused_count` counts fused frames from 1. Moves the volume's window to the camera.
  Fused integrate(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, Volume& volume,
                  std::uint32_t fused_count);

 private:
  [[nodiscard]] std::vector<Brick> find_missing(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                                                const Volume& volume, std::uint32_t fused_count);
  [[nodiscard]] std::uint32_t select(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                                     const Volume& volume, std::uint32_t fused_count);
  [[nodiscard]] Fused fuse(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, const Volume& volume,
                           std::uint32_t fused_count, std::uint32_t count);
  [[nodiscard]] std::vector<Brick> look_through(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                                                const Volume& volume);

  gpu::Device& device_;
  Camera camera_;
  SurfaceOptions options_;
  gpu::Buffer depth_tiles_, new_count_, new_bricks_, free_count_, free_bricks_, selected_count_, selected_, changed_;
  gpu::Kernel<shader::DepthTilesPush> tiles_;
  gpu::Kernel<shader::BrickMarkPush> mark_;
  gpu::Kernel<shader::BrickFreePush> free_;
  gpu::Kernel<shader::BrickSelectPush> select_;
  VoxelKernel<shader::TsdfIntegratePush> integrate_;
};

}  // namespace cairn
