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

/// Allocates the bricks of a frame's truncation band and fuses the frame into all bricks that it sees. The device does
/// it by itself as long as it has vacant slots and the host has none of the bricks.
class Integrator {
 public:
  Integrator(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, const SensorModel& sensor = {});
  /// `fused_count` counts fused frames from 1. Moves the volume's window to the camera.
  Fused integrate(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, Volume& volume,
                  std::uint32_t fused_count);

 private:
  struct Pass;
  [[nodiscard]] Pass pass_over(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                               const Volume& volume, std::uint32_t fused_count);
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
  gpu::Buffer counts_, depth_tiles_, vacant_, missing_, selected_, changed_, free_bricks_;
  std::uint32_t usually_selected_ = 4096;  // bricks, to download at once
  gpu::Kernel<shader::DepthTilesPush> tiles_;
  gpu::Kernel<shader::BrickMarkPush> mark_;
  gpu::Kernel<shader::BrickPlacePush> place_;
  gpu::Kernel<shader::BrickFreePush> free_;
  gpu::Kernel<shader::BrickSelectPush> select_;
  VoxelKernel<shader::TsdfIntegratePush> integrate_;
};

}  // namespace cairn
