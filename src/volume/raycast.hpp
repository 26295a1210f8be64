// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "shaders/surface.h"
#include "surface/prediction.hpp"
#include "volume/volume.hpp"

namespace cairn {

/// Renders the volume's surface as a pyramid of points with normals.
class Raycaster {
 public:
  Raycaster(gpu::Device& device, const Camera& camera, const SurfaceOptions& options, int levels, int finest_level);
  [[nodiscard]] SurfacePrediction raycast(const Volume& volume, const Eigen::Isometry3d& submap_from_camera);

 private:
  gpu::Device& device_;
  SurfaceOptions options_;
  int finest_;
  std::vector<VertexNormalMap> levels_;  // from the finest level on
  gpu::Buffer nearest_, farthest_;
  gpu::Kernel<shader::RaycastRangePush> range_;
  gpu::Kernel<shader::RaycastPush> raycast_;
  gpu::Kernel<shader::SurfaceHalfPush> half_;
};

}  // namespace cairn
