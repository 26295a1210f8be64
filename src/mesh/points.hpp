// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <unordered_set>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Points on surfaces: one per occupied cube of a grid.
class SurfacePoints {
 public:
  /// `spacing`: side of the cubes, meters.
  explicit SurfacePoints(float spacing) : spacing_(spacing) {}
  void add(const Mesh& mesh);
  /// Points so far; no triangles.
  [[nodiscard]] const Mesh& points() const { return points_; }

 private:
  struct Hash {
    std::size_t operator()(const Eigen::Vector3i& c) const {  // Teschner et al. 2003
      return static_cast<std::size_t>(c.x()) * 73856093u ^ static_cast<std::size_t>(c.y()) * 19349669u ^
             static_cast<std::size_t>(c.z()) * 83492791u;
    }
  };
  float spacing_;
  Mesh points_;
  std::unordered_set<Eigen::Vector3i, Hash> taken_;
};

}  // namespace cairn
