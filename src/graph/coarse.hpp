// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A graph of many nodes seen from afar: of each chain of steps that follow each other a few nodes are kept.
#pragma once
#include <cstddef>
#include <vector>

#include "cairn/pose_graph.hpp"

namespace cairn {

/// A step is an edge from a node to the next one that is no loop; what steps join is a chain. Every few nodes of a
/// chain one is kept, its first and its last as well; the steps between two of them become one edge. All other edges go
/// from the kept node that is next to their one end to the one next to their other, by the steps between: their noise
/// is added. Gravity goes to the next kept node likewise.
class CoarseGraph {
 public:
  CoarseGraph(const PoseGraph& fine, std::size_t spacing);

  PoseGraph graph;
  /// Of the fine graph's edges: the one that tells the same. Several may be one; nothing for what lies between nodes
  /// that are one here.
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> edge_of;

  /// The poses of `fine`, the graph that this was made of, as `graph` has them now: what lies between two kept nodes is
  /// bent evenly from one to the other.
  [[nodiscard]] std::vector<Eigen::Isometry3d> spread(const PoseGraph& fine) const;

 private:
  struct Place {
    std::size_t before = 0, after = 0;  // kept nodes of the chain, by their number in `graph`
    double share = 0;                   // of the nodes from one to the other
  };
  std::vector<Place> places_;      // of the fine nodes
  std::vector<std::size_t> kept_;  // fine node by coarse node
};

}  // namespace cairn
