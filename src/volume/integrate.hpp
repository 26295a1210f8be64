// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>

#include "cairn/mapping/sensor_model.hpp"
#include "preprocess/frame_pyramid.hpp"
#include "volume/voxel_kernel.hpp"

namespace cairn {

struct IntegrationResult {
  int touched = 0;                // bricks selected for integration
  std::vector<Brick> changed;     // subset with a changed distance, unordered
  int new_bricks = 0;             // bricks without a slot before
  std::vector<Brick> newly_free;  // bricks with additional free space, sorted
};

/// Allocates the bricks of a frame's truncation band and integrates the frame into all visible bricks. This runs on the
/// device alone as long as vacant slots are left and no needed brick is on the host. Space between the camera and the
/// surfaces is marked as free, as is a ball around the camera, which the camera itself occupies.
class Integrator {
 public:
  /// `camera_radius`: radius of the ball around the camera, meters.
  Integrator(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, const SensorModel& sensor = {},
             float camera_radius = 0);
  static constexpr std::uint32_t kCarvingInterval = 8;  // frames; adjacent frames carve nearly the same voxels
  /// `fused_count` counts integrated frames from 1. Moves the volume's window to the camera. Carves free space with
  /// every `carving_interval`-th frame, starting with the first.
  IntegrationResult integrate(const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera, Volume& volume,
                              std::uint32_t fused_count, std::uint32_t carving_interval = kCarvingInterval);

 private:
  struct Pass;
  [[nodiscard]] Pass pass_over(const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
                               const Volume& volume, std::uint32_t fused_count, bool carves);
  /// Marks the free space of a pass and of the camera's ball. Returns the bricks with additional free space, sorted.
  [[nodiscard]] std::vector<Brick> mark_free(const Pass& pass, const Eigen::Vector3d& camera, Volume& volume) const;
  void place_missing(gpu::Batch& batch, const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
                     const Volume& volume, std::uint32_t fused_count, std::uint32_t vacant);
  void fuse(gpu::Batch& batch, const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
            const Volume& volume, std::uint32_t fused_count, std::uint32_t slots);
  void carve_free_space(gpu::Batch& batch, const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
                        const Volume& volume);
  template <class T>
  void read_rest(std::vector<T>& list, std::uint32_t count, const gpu::Buffer& from);

  gpu::Device& device_;
  Camera camera_;
  SurfaceOptions options_;
  double camera_radius_;  // meters
  gpu::Buffer counts_, farthest_, nearest_, quad_min_depth_, vacant_, missing_, selected_, changed_, free_bricks_,
      part_bricks_, free_voxels_;
  std::uint32_t expected_selected_ = 4096, expected_partly_free_ = 4096;  // bricks to download with the first batch
  gpu::Kernel<shader::DepthTilesPush> tiles_;
  gpu::Kernel<shader::BrickMarkPush> mark_;
  gpu::Kernel<shader::BrickPlacePush> place_;
  gpu::Kernel<shader::DepthTilesPush> find_quad_min_depth_;
  gpu::Kernel<shader::BrickFreePush> free_;
  gpu::Kernel<shader::VoxelFreePush> voxels_free_;
  gpu::Kernel<shader::BrickSelectPush> select_;
  VoxelKernel<shader::TsdfIntegratePush> integrate_;
};

}  // namespace cairn
