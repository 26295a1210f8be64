// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "map/deform.hpp"
#include "volume/merge.hpp"

namespace cairn {

/// A submap and where it lies.
struct PlacedSubmap {
  std::size_t id = 0;         // the same from update to update; its voxels never change
  std::vector<Brick> bricks;  // with voxels
  Deformation deformation;
};

/// A brick of a submap as it lies in the world.
struct PlacedBrick {
  Brick brick;
  Eigen::Isometry3d world_from_submap;
};

/// Gives what a submap knows to be free, with or without its voxels.
using LoadFree = std::function<std::shared_ptr<const BrickTree>(std::size_t submap)>;

/// What is free in the world, without voxels: of each voxel, whether the nearest one of a submap is.
[[nodiscard]] BrickTree free_space(const FuseOptions& options, const std::vector<PlacedSubmap>& submaps,
                                   const LoadFree& load);

/// The world part by part, for what needs all of it and never at once: its bricks are known, their voxels are made when
/// they are asked for.
class WorldParts {
 public:
  WorldParts(gpu::Device& device, const FuseOptions& options, const std::vector<PlacedSubmap>& submaps);
  /// All bricks that submaps reach, sorted; some may turn out to hold nothing.
  [[nodiscard]] const std::vector<Brick>& bricks() const { return bricks_; }
  /// The voxels of some bricks. `load(id)` gives a submap's.
  [[nodiscard]] BrickTree make(std::span<const Brick> bricks, const LoadSubmap& load);

 private:
  double brick_size_;
  Merger merger_;
  std::vector<std::vector<PlacedBrick>> placed_;  // by submap
  std::vector<Brick> bricks_;
};

/// The volume of the world: all submaps, moved and bent as the pose graph says.
class World {
 public:
  World(gpu::Device& device, const FuseOptions& options);
  /// Fuses again what changed: bricks of submaps that are new or gone, or moved by more than a fraction of a voxel.
  /// `load(id)` gives a submap's voxels, `load_free(id)` what is free in it. Returns the bricks that were made, and
  /// those in which voxels came to be free, or no longer are, sorted.
  std::vector<Brick> update(const std::vector<PlacedSubmap>& submaps, const LoadSubmap& load,
                            const LoadFree& load_free);
  [[nodiscard]] const BrickTree& bricks() const { return bricks_; }
  /// Gives the bricks away; the world is empty afterwards.
  [[nodiscard]] BrickTree release();

 private:
  [[nodiscard]] std::vector<Brick> take_free(BrickTree free);
  FuseOptions options_;
  Merger merger_;
  BrickTree bricks_;
  std::vector<std::vector<PlacedBrick>> placements_;  // by submap, as last fused
};

}  // namespace cairn
