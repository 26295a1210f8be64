// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
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
};

/// `voxel`: metres, of the map.
[[nodiscard]] StoreyPlan plan_of(const Survey& survey, double voxel);

/// What lies between two faces of a wall, at most 0.6 m apart, and small gaps that this leaves where walls meet.
[[nodiscard]] Mask solid_between(const Survey& survey, const Sides& sides);

/// Parts of `open` that walls and doors close off. `walls`: lines and what is solid.
[[nodiscard]] std::vector<Room> rooms_in(const Grid& grid, const Mask& open, const Mask& walls, const Mask& solid,
                                         const Sides& sides);

}  // namespace cairn::plan
