// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <unordered_map>

#include "cairn/mesh.hpp"
#include "volume/volume.hpp"

namespace cairn {

/// The colours of a mesh's vertices as means over the cubes of a grid, to ask for at points in between.
class VoxelColours {
 public:
  /// `size`: side of the cubes, metres.
  VoxelColours(const Mesh& mesh, float size);
  /// Bytes R, G, B of the surroundings; `otherwise` where there is no vertex.
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
