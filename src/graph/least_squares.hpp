// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Least-squares poses of a graph for given edge weights.
#pragma once
#include <array>
#include <vector>

#include "cairn/mapping/pose_graph.hpp"
#include "graph/inertial_graph.hpp"

namespace cairn {

using NodePose = std::array<double, 7>;  // quaternion x y z w, translation

[[nodiscard]] NodePose node_pose(const Eigen::Isometry3d& t);
[[nodiscard]] Eigen::Isometry3d pose(const NodePose& p);
[[nodiscard]] std::vector<NodePose> node_poses(const std::vector<Eigen::Isometry3d>& poses);
[[nodiscard]] std::vector<Eigen::Isometry3d> poses(const std::vector<NodePose>& nodes);

/// Squared errors in units of the edge's noise; squared_errors() ignores the weights.
[[nodiscard]] double squared_error(const PoseGraph::Edge& edge, const std::vector<NodePose>& poses);
[[nodiscard]] std::vector<double> squared_errors(const PoseGraph& graph, const std::vector<NodePose>& poses);

/// Half the sum of the weighted squared errors, including gravity.
[[nodiscard]] double cost(const PoseGraph& graph, const std::vector<NodePose>& poses,
                          const std::vector<double>& weights);

/// Levenberg-Marquardt over the edges of positive weight, starting at `poses`. The first node of each component is
/// fixed. `inertial`: used and updated as by optimize(); may be null. Returns the number of iterations. Throws
/// std::runtime_error without a usable solution.
int solve(const PoseGraph& graph, const std::vector<double>& weights, int iterations, std::vector<NodePose>& poses,
          InertialGraph* inertial = nullptr);

}  // namespace cairn
