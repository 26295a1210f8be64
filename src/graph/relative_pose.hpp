// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Composition of relative poses with covariance.
#pragma once
#include <cstddef>
#include <vector>

#include "cairn/mapping/pose.hpp"
#include "cairn/mapping/pose_graph.hpp"

namespace cairn {

/// Relative pose along a chain of edges, with its covariance.
struct RelativePose {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // of the end in the frame of the start
  Matrix6d covariance = Matrix6d::Zero();                  // in the frame of the end; radians, meters
};

/// Composition of two relative poses; first order in their noise, which is independent.
inline RelativePose compose(const RelativePose& a, const RelativePose& b) {
  const Matrix6d ad = adjoint(b.pose.inverse());
  return {a.pose * b.pose, Matrix6d(ad * a.covariance * ad.transpose() + b.covariance)};
}
inline RelativePose inverse(const RelativePose& a) {
  const Matrix6d ad = adjoint(a.pose);
  return {a.pose.inverse(), Matrix6d(ad * a.covariance * ad.transpose())};
}

/// By node: the odometry edge to the next node, the last of several; nullptr if there is none.
inline std::vector<const PoseGraph::Edge*> steps_of(const PoseGraph& graph) {
  std::vector<const PoseGraph::Edge*> step(graph.world_from_node.size(), nullptr);
  for (const auto& edge : graph.edges)
    if (!edge.is_loop_closure && edge.j == edge.i + 1) step[edge.i] = &edge;
  return step;
}

inline RelativePose along(const PoseGraph::Edge& edge) { return {edge.i_from_j, edge.information.inverse()}; }

}  // namespace cairn
