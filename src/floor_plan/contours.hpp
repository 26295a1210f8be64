// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "floor_plan/grid.hpp"

namespace cairn::plan {

/// Segment of a horizontal section of a surface, with free space on its left.
struct Segment {
  Point a, b;
};

/// Intersects a mesh with a horizontal plane; `height`: meters above the world's origin.
void cut(const Mesh& mesh, double height, std::vector<Segment>& segments);

/// Joins segments end to start, in any order. Free space is on the left of each polyline.
[[nodiscard]] std::vector<Polyline> joined(std::vector<Segment> segments);

}  // namespace cairn::plan
