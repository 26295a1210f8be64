// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mesh.hpp"
#include "plan/grid.hpp"

namespace cairn::plan {

/// A piece of a surface that is cut level, with free space on its left.
struct Segment {
  Point a, b;
};

/// Where a level plane cuts a mesh; `height`: metres above the world's origin.
void cut(const Mesh& mesh, double height, std::vector<Segment>& segments);

/// Segments joined where one begins as another ends, whatever their order was. Free space is on the left of each.
[[nodiscard]] std::vector<Polyline> joined(std::vector<Segment> segments);

}  // namespace cairn::plan
