// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "map/deform.hpp"
#include "volume/merge.hpp"

namespace cairn {

/// A submap and where it lies.
struct PlacedSubmap {
  std::size_t id = 0;               // the same from update to update; its voxels never change
  std::vector<Brick> bricks, free;  // with voxels; without, but seen to be empty
  Deformation deformation;
};

/// The volume of the world: all submaps, moved and bent as the pose graph says.
class World {
 public:
  World(gpu::Device& device, const FuseOptions& options);
  /// Fuses again what changed: bricks of submaps that are new or gone, or moved by more than a fraction of a voxel.
  /// `load(id)` gives a submap's voxels. Returns the bricks that were made, came to be
  /// free, or no longer are, sorted.
  std::vector<Brick> update(const std::vector<PlacedSubmap>& submaps, const LoadSubmap& load);
  [[nodiscard]] const BrickTree& bricks() const { return bricks_; }
  /// Gives the bricks away; the world is empty afterwards.
  [[nodiscard]] BrickTree release();

 private:
  [[nodiscard]] std::vector<Brick> move_free(const std::vector<PlacedSubmap>& submaps);
  struct Placement {
    Brick brick;
    Eigen::Isometry3d world_from_submap;
  };
  FuseOptions options_;
  Merge merge_;
  BrickTree bricks_;
  std::vector<std::vector<Placement>> placements_;  // by submap, as last fused
};

}  // namespace cairn
