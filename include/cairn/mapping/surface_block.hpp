// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Mesh of one cube of the submap's frame. It replaces the cube's previous mesh.
struct SurfaceBlock {
  int submap = 0;
  Eigen::Vector3i cell = Eigen::Vector3i::Zero();  ///< index of the cube
  /// In the submap's frame; may be empty. The fourth byte of its colors is the confidence of a vertex: 255 after about
  /// eight observations at 1 m (32 at 2 m), reduced in proportion to the certainty of its position.
  Mesh mesh;
};

}  // namespace cairn
