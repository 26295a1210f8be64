// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <map>
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn::plan {

/// Area of upward-facing surface by height. Heights are meters above the world's origin: -y.
class LevelSurface {
 public:
  /// Adds a part of the map's surface, in the world.
  void add(const Mesh& mesh);
  /// Heights of floors, the lowest first. A floor is a level with much upward-facing surface below the camera's path;
  /// of levels less than a storey from each other, the lowest. Without paths the surface alone decides.
  [[nodiscard]] std::vector<double> floors(const std::vector<Trajectory>& paths) const;

 private:
  [[nodiscard]] double area_around(int bin) const;
  [[nodiscard]] double weighted_area_around(int bin) const;
  [[nodiscard]] double height_around(int bin) const;
  struct Level {
    double area = 0, height = 0;  // m2; mean, meters
  };
  std::map<int, Level> area_;  // by centimeter of height
};

/// Meters above the world's origin.
[[nodiscard]] inline double height_of(const Eigen::Vector3d& p) { return -p.y(); }

}  // namespace cairn::plan
