// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Surface orientations in a depth image, for floors and walls.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "cairn/mapping/rig.hpp"

namespace cairn {

/// Dominant surface normals of an image, in the camera's frame.
struct Structure {
  struct Facing {
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // unit length, towards the camera
    float area = 0;                                    // m^2 of flat patches with this normal
  };
  std::vector<Facing> facings;  // largest first, at most kFacings
  float area = 0;               // of all flat patches

  static constexpr std::size_t kFacings = 10;
};

/// Divides depth images into patches, fits a plane to each, and groups patches with similar normals.
class StructureFinder {
 public:
  explicit StructureFinder(const Rig& rig);
  /// `depth`: by pixel of the rig's depth camera, meters; see Frame.
  [[nodiscard]] Structure find(const std::vector<float>& depth) const;

 private:
  Camera camera_;
  SensorModel sensor_;
  int side_, step_;                    // of a patch, and between its sampled pixels
  std::vector<Eigen::Vector2f> rays_;  // by pixel: (x, y) at z = 1, undistorted
};

}  // namespace cairn
