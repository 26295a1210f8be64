// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The poses of a graph that fit its edges best, for given weights.
#pragma once
#include <array>
#include <vector>

#include "cairn/pose_graph.hpp"

namespace cairn {

using NodePose = std::array<double, 7>;  // quaternion x y z w, translation

[[nodiscard]] NodePose node_pose(const Eigen::Isometry3d& t);
[[nodiscard]] Eigen::Isometry3d pose(const NodePose& p);
[[nodiscard]] std::vector<NodePose> node_poses(const std::vector<Eigen::Isometry3d>& poses);
[[nodiscard]] std::vector<Eigen::Isometry3d> poses(const std::vector<NodePose>& nodes);

/// In units of the edge's noise; of all edges by their numbers, whatever their weights.
[[nodiscard]] double squared_error(const PoseGraph::Edge& edge, const std::vector<NodePose>& poses);
[[nodiscard]] std::vector<double> squared_errors(const PoseGraph& graph, const std::vector<NodePose>& poses);

/// Half the sum of the squared errors, gravity's as well.
[[nodiscard]] double cost(const PoseGraph& graph, const std::vector<NodePose>& poses,
                          const std::vector<double>& weights);

/// Levenberg-Marquardt over the edges of more than no weight, from `poses` on. The first node of each component stays.
/// Returns its iterations. Throws std::runtime_error where there is no solution.
int solve(const PoseGraph& graph, const std::vector<double>& weights, int iterations, std::vector<NodePose>& poses);

}  // namespace cairn
