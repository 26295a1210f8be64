// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "surface/surface.hpp"

namespace cairn {

/// The model seen from a pose. The buffers belong to Raycaster and hold until its next call.
struct SurfacePrediction {
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  std::vector<const VertexNormalMap*> levels;  // as in Surface; null above the finest level that was asked for
};

}  // namespace cairn
