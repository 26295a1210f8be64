// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <vector>

#include "floor_plan/segment_index.hpp"
#include "floor_plan/storey_raster.hpp"
#include "floor_plan/straighten.hpp"

namespace cairn::plan {

/// Room with walls or doors all around.
struct Room {
  Point middle = Point::Zero();  // best position for a label
  double area = 0;               // m2, inside its lines
  Area outline;                  // at its lines
};

/// Storey as drawn.
struct StoreyPlan {
  double floor = 0;          // meters above the world's origin
  double height = 0;         // meters from the floor to the ceiling; kNominalHeight without an observed ceiling
  StraightLines walls;       // faces of walls and of other objects at the cut
  std::vector<Area> solid;   // between two observed faces
  std::vector<Area> floors;  // observed
  std::vector<Area> furniture, unseen;
  std::vector<Segment> doors;  // openings between two facing jambs
  std::vector<Room> rooms;
  double floor_area = 0;  // m2 observed, including furniture
  /// With Coverage::included, `unseen` is the unobserved area inside the building's outline instead of the enclosed
  /// holes.
  double unobserved_area = 0, unobserved_share = 0;  // m2, and share of the area inside the outline
};

inline constexpr double kNominalHeight = 2.5;  // meters of a storey

enum class Edges : std::uint8_t { simplified, straight };

/// Areas of a mask, without very small ones.
[[nodiscard]] std::vector<Area> polygons_of(const Grid& grid, const Mask& mask, Edges edges = Edges::simplified);

enum class Coverage : std::uint8_t { omitted, included };

/// `voxel`: meters, of the map.
[[nodiscard]] StoreyPlan plan_of(const StoreyRaster& raster, double voxel, Coverage coverage = Coverage::omitted);

/// Known inside of a building's outline: cells enclosed by known cells, or with known cells on three of the four sides
/// along its walls, two of them opposite within a room's length. `angle`: of its walls, radians.
[[nodiscard]] Mask within_outline(const Grid& grid, const Mask& observed, double angle);

/// Solid between two faces of a wall, at most 0.6 m thick, and small remaining gaps where walls meet.
[[nodiscard]] Mask solid_between(const StoreyRaster& raster, const SegmentIndex& sides);

/// Openings of 0.5 to 1.6 m between the ends of two walls that face each other.
[[nodiscard]] std::vector<Segment> doors_between(const Grid& grid, const Mask& solid, const SegmentIndex& sides);

/// Parts of `open` enclosed by walls and doors. `walls`: lines and solid.
[[nodiscard]] std::vector<Room> rooms_in(const Grid& grid, const Mask& open, const Mask& walls,
                                         const std::vector<Segment>& doors);

}  // namespace cairn::plan
