// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "plan/sides.hpp"
#include "plan/straighten.hpp"
#include "plan/survey.hpp"

namespace cairn::plan {

/// A room with walls or doors all around.
struct Room {
  Point middle = Point::Zero();  // where there is most room for a label
  double area = 0;               // m2, within its lines
};

/// A storey as it is drawn.
struct StoreyPlan {
  double floor = 0;          // metres above the world's origin
  StraightLines walls;       // faces of walls, and of all else that is cut
  std::vector<Area> solid;   // between two faces that are seen
  std::vector<Area> floors;  // seen
  std::vector<Area> furniture, unseen;
  std::vector<Room> rooms;
  double floor_area = 0;  // m2 that were seen, furniture included
  /// Where nobody looked within the building's outline, in place of what is unseen with something seen around it.
  double not_looked_at = 0, not_looked_at_share = 0;  // m2, and of these and what was looked at
};

enum class Coverage : std::uint8_t { left_out, told };

/// `voxel`: metres, of the map.
[[nodiscard]] StoreyPlan plan_of(const Survey& survey, double voxel, Coverage coverage = Coverage::left_out);

/// What lies within a building's outline, as far as that is known: what has something known around it, or on three of
/// the four sides along its walls, on two opposite ones within a room's length. `angle`: of its walls, radians.
[[nodiscard]] Mask within_outline(const Grid& grid, const Mask& known, double angle);

/// What lies between two faces of a wall, at most 0.6 m apart, and small gaps that this leaves where walls meet.
[[nodiscard]] Mask solid_between(const Survey& survey, const Sides& sides);

/// Parts of `open` that walls and doors close off. `walls`: lines and what is solid.
[[nodiscard]] std::vector<Room> rooms_in(const Grid& grid, const Mask& open, const Mask& walls, const Mask& solid,
                                         const Sides& sides);

}  // namespace cairn::plan
