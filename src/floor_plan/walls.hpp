// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Walls and their doors as solids with a middle line, for building models.
#pragma once
#include <vector>

#include "floor_plan/storey_plan.hpp"

namespace cairn::plan {

struct Wall {
  Point from = Point::Zero(), to = Point::Zero();  // middle line, meters
  double thickness = 0;                            // meters
  bool has_two_faces = false;                      // both were observed; otherwise the thickness is kNominalThickness
  struct Opening {
    double begin = 0, end = 0;  // meters along the middle line from `from`
  };
  std::vector<Opening> doors;

  [[nodiscard]] double length() const { return (to - from).norm(); }
};

inline constexpr double kNominalThickness = 0.1;  // meters

/// Walls of a storey: between two faces that oppose each other, and behind each other face. Pieces in line are one
/// wall, across crossings and doors. Sorted by the faces' order.
[[nodiscard]] std::vector<Wall> walls_of(const StoreyPlan& plan);

}  // namespace cairn::plan
