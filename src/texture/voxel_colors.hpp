// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <unordered_map>

#include "cairn/mapping/mesh.hpp"
#include "volume/volume.hpp"

namespace cairn {

/// Mean vertex colors of a mesh in the cubes of a grid, for interpolation.
class VoxelColors {
 public:
  /// `size`: side of the cubes, meters.
  VoxelColors(const Mesh& mesh, float size);
  /// Interpolated color, bytes R, G, B; `otherwise` if no vertex is near.
  [[nodiscard]] std::uint32_t at(const Eigen::Vector3f& point, std::uint32_t otherwise) const;

 private:
  struct Mean {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float count = 0;
  };
  float size_;
  std::unordered_map<Eigen::Vector3i, Mean, BrickHash> means_;
};

}  // namespace cairn
