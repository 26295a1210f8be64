// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <map>
#include <vector>

#include "cairn/mesh.hpp"
#include "cairn/trajectory.hpp"

namespace cairn::plan {

/// How much surface of a map faces up at which height. Heights are metres above the world's origin: -y.
class LevelSurface {
 public:
  /// Adds a part of the map's surface, in the world.
  void add(const Mesh& mesh);
  /// Heights of floors, the lowest first. A floor is a level with much surface that faces up, above which the camera
  /// went; of levels that lie less than a storey above each other the lowest. Without paths their surface alone tells.
  [[nodiscard]] std::vector<double> floors(const std::vector<Trajectory>& paths) const;

 private:
  [[nodiscard]] double around(int bin) const;
  [[nodiscard]] double nearness(int bin) const;
  [[nodiscard]] double middle_around(int bin) const;
  struct Level {
    double area = 0, height = 0;  // m2; metres, on the mean
  };
  std::map<int, Level> area_;  // by centimetre of height
};

/// Metres above the world's origin.
[[nodiscard]] inline double height_of(const Eigen::Vector3d& p) { return -p.y(); }

}  // namespace cairn::plan
