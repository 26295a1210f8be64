// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

#include "graph/pose_graph.hpp"

namespace cairn {

/// For each node the first node that edges of more than no weight join it to: itself for the first of a component.
inline std::vector<std::size_t> component_of(const PoseGraph& graph, const std::vector<double>& weights) {
  std::vector<std::size_t> parent(graph.world_from_node.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (std::size_t k = 0; k < graph.edges.size(); ++k) {
    if (weights[k] <= 0) continue;
    const std::size_t a = root(graph.edges[k].i), b = root(graph.edges[k].j);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (std::size_t i = 0; i < parent.size(); ++i) parent[i] = root(i);
  return parent;
}

}  // namespace cairn
