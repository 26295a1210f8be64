// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Inertial measurements of a pose graph.
#pragma once
#include <optional>
#include <vector>

#include "cairn/mapping/pose_graph.hpp"
#include "inertial/preintegration.hpp"

namespace cairn {

/// Pre-integrated motions between nodes of a pose graph. Each connected component has one gravity direction, estimated
/// with the poses: it holds roll and pitch of all nodes, so that loop closures have four degrees of freedom.
struct InertialGraph {
  struct Step {
    std::size_t i = 0, j = 0;  // nodes with an edge between them, in order of time
    Preintegration motion;
  };
  std::vector<Step> steps;                              // by time
  std::vector<std::optional<Eigen::Vector3d>> gravity;  // by node: in its frame, m/s^2; none: unknown
  InertialMount mount;
  InertialNoise noise;
};

/// optimize() with the inertial measurements in addition, which also gives `inertial` the gravity of each node. In a
/// component without a node of known gravity they are ignored, and until the last solution of a large graph.
OptimizeReport optimize(PoseGraph& graph, InertialGraph* inertial, const OptimizeOptions& options = {});

}  // namespace cairn
