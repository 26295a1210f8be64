// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "plan/sides.hpp"
#include "plan/straighten.hpp"
#include "plan/survey.hpp"

namespace cairn::plan {

/// Room with walls or doors all around.
struct Room {
  Point middle = Point::Zero();  // best position for a label
  double area = 0;               // m2, inside its lines
};

/// Storey as drawn.
struct StoreyPlan {
  double floor = 0;          // meters above the world's origin
  StraightLines walls;       // faces of walls and of other objects at the cut
  std::vector<Area> solid;   // between two observed faces
  std::vector<Area> floors;  // observed
  std::vector<Area> furniture, unseen;
  std::vector<Room> rooms;
  double floor_area = 0;  // m2 observed, including furniture
  /// With Coverage::told, `unseen` is the unobserved area inside the building's outline instead of the enclosed holes.
  double not_looked_at = 0, not_looked_at_share = 0;  // m2, and share of the area inside the outline
};

enum class Coverage : std::uint8_t { left_out, told };

/// `voxel`: meters, of the map.
[[nodiscard]] StoreyPlan plan_of(const Survey& survey, double voxel, Coverage coverage = Coverage::left_out);

/// Known inside of a building's outline: cells enclosed by known cells, or with known cells on three of the four sides
/// along its walls, two of them opposite within a room's length. `angle`: of its walls, radians.
[[nodiscard]] Mask within_outline(const Grid& grid, const Mask& known, double angle);

/// Solid between two faces of a wall, at most 0.6 m thick, and small remaining gaps where walls meet.
[[nodiscard]] Mask solid_between(const Survey& survey, const Sides& sides);

/// Parts of `open` enclosed by walls and doors. `walls`: lines and solid.
[[nodiscard]] std::vector<Room> rooms_in(const Grid& grid, const Mask& open, const Mask& walls, const Mask& solid,
                                         const Sides& sides);

}  // namespace cairn::plan
