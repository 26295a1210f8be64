// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Which loops may be false, by what their neighbours tell.
#pragma once
#include <vector>

#include "cairn/pose_graph.hpp"

namespace cairn {

/// Weights of all edges to begin with: loops that others contradict have none; nor have those that none agrees with,
/// where these are too many. `limit`: of the squared error in units of noise by which two may differ.
[[nodiscard]] std::vector<double> first_weights(const PoseGraph& graph, double limit);

}  // namespace cairn
