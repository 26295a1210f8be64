// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <ceres/problem.h>

#include <array>
#include <map>
#include <vector>

#include "graph/inertial_graph.hpp"
#include "graph/least_squares.hpp"

namespace cairn {

/// Inertial part of a least-squares problem over the poses of a graph. Must outlive the solution.
class InertialProblem {
 public:
  /// Adds the steps to the problem. `anchors`: first node of each node's component. Both outlive this object.
  InertialProblem(InertialGraph& inertial, const std::vector<std::size_t>& anchors, std::vector<NodePose>& poses,
                  ceres::Problem& problem);
  /// Writes the solution's gravity to the nodes.
  void finish();

 private:
  using Motion = std::array<double, 9>;  // velocity, bias of the gyroscope, bias of the accelerometer
  void start_gravity();
  void start_motion(const InertialGraph::Step& step);
  void add_step(const InertialGraph::Step& step, bool starts_chain, ceres::Problem& problem);

  InertialGraph& inertial_;
  const std::vector<std::size_t>& anchors_;
  std::vector<NodePose>& poses_;
  std::map<std::size_t, Eigen::Vector3d> gravity_;  // by anchor, in the world
  std::vector<Motion> motions_;                     // by node
};

}  // namespace cairn
