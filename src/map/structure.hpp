// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a depth image shows of floors and walls: where its flat parts face.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "cairn/rig.hpp"

namespace cairn {

/// Where the surface that an image shows faces, in the camera's frame.
struct Structure {
  struct Facing {
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // unit length, towards the camera
    float area = 0;                                    // m^2 of flat patches that face there
  };
  std::vector<Facing> facings;  // those of most area, at most kFacings
  float area = 0;               // of all flat patches

  static constexpr std::size_t kFacings = 10;
};

/// Cuts depth images into patches, fits a plane to each, and gathers those that face alike.
class StructureFinder {
 public:
  explicit StructureFinder(const Rig& rig);
  /// `depth`: by pixel of the rig's depth camera, metres; see Frame.
  [[nodiscard]] Structure find(const std::vector<float>& depth) const;

 private:
  Camera camera_;
  SensorModel sensor_;
  int side_, step_;                    // of a patch, and between the pixels of it that count
  std::vector<Eigen::Vector2f> rays_;  // by pixel: (x, y) at z = 1, without the lens
};

}  // namespace cairn
