// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "map/atlas.hpp"

namespace cairn {

/// How a submap is bent when the pose graph has moved its keyframes: each point goes with the keyframes that look at it
/// from near (blended rigid motions, as the embedded deformation of Sumner, Schmid & Pauly 2007). Smooth everywhere,
/// and across the border to the next submap, since the neighbours' keyframes take part.
class Deformation {
 public:
  Deformation(const Atlas& atlas, std::size_t submap);
  /// Those that bend a submap: its own, and those next to them in their piece, sorted.
  [[nodiscard]] static std::vector<std::size_t> keyframes_of(const Atlas& atlas, std::size_t submap);
  /// world_from_submap at a point of the submap, metres.
  [[nodiscard]] Eigen::Isometry3d operator()(const Eigen::Vector3d& point) const;

 private:
  struct Control {
    Eigen::Vector3d centre, forward;  // of the camera in the submap
    Eigen::Quaterniond rotation;      // world_from_submap
    Eigen::Isometry3d move;
  };
  std::vector<Control> controls_;
  bool is_rigid_ = true;
};

}  // namespace cairn
