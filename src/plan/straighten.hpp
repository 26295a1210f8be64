// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "plan/grid.hpp"

namespace cairn::plan {

/// Lines drawn in place of contours, and how far they are from these: metres, by length of the contours.
struct StraightLines {
  std::vector<Polyline> lines;  // free space on the left
  double direction = 0;         // radians, 0 to pi / 2: more walls run along it or across it than otherwise
  double share = 0;             // of their length
  double length = 0;            // of the contours
  double mean_off = 0, p95_off = 0, max_off = 0;
};

/// Straight runs (Douglas & Peucker 1973) with a line fitted to each, which meet at corners. Where most walls have one
/// direction or stand at right angles to it, what is nearly so is turned to be so, unless its ends would move by more
/// than a voxel. Contours too small to be a wall are left out.
[[nodiscard]] StraightLines straightened(const std::vector<Polyline>& contours, double voxel);

/// Points that a line through them does not need to stay within a distance (Douglas & Peucker 1973).
[[nodiscard]] Polyline simplified(const Polyline& line, double distance);

/// How far a point is from a straight line between two others.
[[nodiscard]] double distance_to(const Point& p, const Point& a, const Point& b);

}  // namespace cairn::plan
