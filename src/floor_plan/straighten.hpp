// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "floor_plan/grid.hpp"

namespace cairn::plan {

/// Lines that replace contours, and their distances from the contours: meters, weighted by length.
struct StraightLines {
  std::vector<Polyline> lines;  // free space on the left
  double direction = 0;         // radians, 0 to pi / 2: most walls are parallel or perpendicular to it
  double share = 0;             // of their length
  double length = 0;            // of the contours
  double mean_off = 0, p95_off = 0, max_off = 0;
};

/// Splits contours into straight runs (Douglas & Peucker 1973), fits a line to each, and intersects lines at corners.
/// If most walls are parallel or perpendicular to a direction, rotates nearly aligned runs into it, unless their ends
/// would move by more than a voxel. Drops contours too small for a wall.
[[nodiscard]] StraightLines straightened(const std::vector<Polyline>& contours, double voxel);

/// Simplifies a line within a maximum distance (Douglas & Peucker 1973).
[[nodiscard]] Polyline simplified(const Polyline& line, double distance);

/// Distance of a point from a straight line between two others.
[[nodiscard]] double distance_to(const Point& p, const Point& a, const Point& b);

}  // namespace cairn::plan
