// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Coarse pose graph of a large graph, with a few nodes of each chain of odometry steps.
#pragma once
#include <cstddef>
#include <vector>

#include "cairn/mapping/pose_graph.hpp"

namespace cairn {

/// Coarse pose graph. A step is an edge, other than a loop closure, from a node to the next; consecutive steps form a
/// chain. The graph keeps a node every few nodes of a chain, with its first and last; the steps between two kept nodes
/// become one edge. Each remaining edge connects the kept nodes nearest to its ends, with the noise of the steps
/// between added. Gravity moves to the nearest kept node likewise.
class CoarseGraph {
 public:
  CoarseGraph(const PoseGraph& fine, std::size_t spacing);

  PoseGraph graph;
  /// Coarse edge of each fine edge. Several fine edges may share a coarse edge; kNone for an edge within one coarse
  /// node.
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> edge_of;

  /// Poses of `fine`, the graph of the constructor, from the current poses of `graph`: between two kept nodes the
  /// correction is interpolated evenly.
  [[nodiscard]] std::vector<Eigen::Isometry3d> interpolate(const PoseGraph& fine) const;

 private:
  struct Place {
    std::size_t before = 0, after = 0;  // kept nodes of the chain, as indices into `graph`
    double share = 0;                   // position between the two, 0..1, by number of nodes
  };
  std::vector<Place> places_;      // by fine node
  std::vector<std::size_t> kept_;  // fine node by coarse node
};

}  // namespace cairn
