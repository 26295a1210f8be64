// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <map>
#include <optional>
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn::plan {

/// Area of level surface by height. Heights are meters above the world's origin: -y.
class LevelSurface {
 public:
  /// Adds a part of the map's surface, in the world.
  void add(const Mesh& mesh);
  /// Heights of floors, the lowest first. A floor is a level with much upward-facing surface below the camera's path;
  /// of levels less than a storey from each other, the lowest. Without paths the surface alone decides.
  [[nodiscard]] std::vector<double> floors(const std::vector<Trajectory>& paths) const;
  /// Meters from a floor to the ceiling: the level with most downward-facing surface up to `max`. Empty if there is no
  /// ceiling of a quarter of a square meter.
  [[nodiscard]] std::optional<double> height_above(double floor, double max) const;

 private:
  struct Level {
    double area = 0, height = 0;  // m2; mean, meters
  };
  using Levels = std::map<int, Level>;  // by centimeter of height
  static double area_around(const Levels& levels, int bin);
  static double weighted_area_around(const Levels& levels, int bin);
  static double height_around(const Levels& levels, int bin);
  Levels upward_, downward_;  // by the surface's normal
};

/// Meters above the world's origin.
[[nodiscard]] inline double height_of(const Eigen::Vector3d& p) { return -p.y(); }

}  // namespace cairn::plan
