// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <vector>

#include "preprocess/frame_pyramid.hpp"

namespace cairn {

/// Surface of the model predicted at a pose. The buffers are owned by Raycaster and valid until its next call.
struct SurfacePrediction {
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  std::vector<const VertexNormalMap*> levels;  // as in FramePyramid; null above the finest requested level
};

}  // namespace cairn
