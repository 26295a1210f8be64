// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Initial rejection of loop closures by pairwise consistency.
#pragma once
#include <vector>

#include "cairn/mapping/pose_graph.hpp"

namespace cairn {

/// Initial weights of all edges: zero for loop closures contradicted by their neighbors, and for isolated ones if there
/// are too many. `limit`: of the squared error in units of noise between two agreeing loop closures.
[[nodiscard]] std::vector<double> initial_weights(const PoseGraph& graph, double limit);

}  // namespace cairn
