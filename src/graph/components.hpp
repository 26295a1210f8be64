// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <vector>

#include "base/union_find.hpp"
#include "cairn/mapping/pose_graph.hpp"

namespace cairn {

/// For each node, the first node of its connected component over edges of positive weight.
inline std::vector<std::size_t> component_of(const PoseGraph& graph, const std::vector<double>& weights) {
  UnionFind<std::size_t> sets(graph.world_from_node.size());
  for (std::size_t k = 0; k < graph.edges.size(); ++k)
    if (weights[k] > 0) sets.join(graph.edges[k].i, graph.edges[k].j);
  return sets.all();
}

}  // namespace cairn
