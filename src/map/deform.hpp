// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

/// Deformation of a submap after pose graph optimization: each point follows the keyframes that view it from nearby
/// (blended rigid motions, as in the embedded deformation of Sumner, Schmid & Pauly 2007). Smooth everywhere, also
/// across the border to the next submap, since the neighbors' keyframes take part.
class Deformation {
 public:
  Deformation(const Atlas& atlas, std::size_t submap);
  /// Keyframes that deform a submap: its own and their neighbors in the same component, sorted.
  [[nodiscard]] static std::vector<std::size_t> keyframes_of(const Atlas& atlas, std::size_t submap);
  /// world_from_submap at a point of the submap, meters.
  [[nodiscard]] Eigen::Isometry3d operator()(const Eigen::Vector3d& point) const;

 private:
  struct Control {
    Eigen::Vector3d center, forward;  // of the camera, in the submap frame
    Eigen::Quaterniond rotation;      // world_from_submap
    Eigen::Isometry3d move;
  };
  std::vector<Control> controls_;
  bool is_rigid_ = true;
};

}  // namespace cairn
