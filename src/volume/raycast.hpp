// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "preprocess/prediction.hpp"
#include "shaders/surface.h"
#include "volume/voxel_kernel.hpp"

namespace cairn {

/// Renders the surface of a volume as a pyramid of points with normals.
class Raycaster {
 public:
  Raycaster(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, int levels, int finest_level);
  [[nodiscard]] SurfacePrediction raycast(const Volume& volume, const Eigen::Isometry3d& submap_from_camera);

  /// Saved prediction; no prediction if `points` is empty.
  struct SavedState {
    Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
    std::vector<std::uint32_t> points;  // finest level
  };
  /// Saves the last prediction; `view` must be that prediction.
  [[nodiscard]] SavedState save(const SurfacePrediction& view) const;
  /// Returns a prediction without levels if none was saved or its size differs.
  [[nodiscard]] SurfacePrediction restore(const SavedState& saved);

 private:
  void halve(gpu::Batch& batch);
  [[nodiscard]] SurfacePrediction view_from(const Eigen::Isometry3d& submap_from_camera) const;

  gpu::Device& device_;
  SurfaceOptions options_;
  int finest_;
  std::vector<VertexNormalMap> levels_;  // finest level first
  gpu::Buffer nearest_, farthest_;
  gpu::Kernel<shader::RaycastRangePush> range_;
  VoxelKernel<shader::RaycastPush> raycast_;
  gpu::Kernel<shader::SurfaceHalfPush> half_;
};

}  // namespace cairn
