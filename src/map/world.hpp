// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "map/deform.hpp"
#include "volume/brick_set.hpp"
#include "volume/merge.hpp"

namespace cairn {

/// A submap and where it lies.
struct PlacedSubmap {
  std::size_t id = 0;                      // the same from update to update; its voxels never change
  std::shared_ptr<const BrickSet> bricks;  // with voxels
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

/// A cube of the world, cell_of() of its bricks, and the submaps that what is in it is made of.
struct ReachedCell {
  Brick cell;
  std::vector<std::size_t> submaps;  // by their ids, sorted
};
/// All cells of `side` bricks that hold a brick of a submap, sorted. Submaps count as well where they reach to within
/// `margin` bricks of a cell.
[[nodiscard]] std::vector<ReachedCell> reached_cells(const FuseOptions& options,
                                                     const std::vector<PlacedSubmap>& submaps, int side, int margin);

/// The world part by part, for what needs all of it and never at once: it is known which bricks there are, and they are
/// made when they are asked for, out of the submaps that reach there.
class WorldParts {
 public:
  WorldParts(gpu::Device& device, const FuseOptions& options, std::vector<PlacedSubmap> submaps);
  /// All that submaps reach with voxels, sorted; some may turn out to hold nothing.
  [[nodiscard]] std::vector<Brick> bricks() const { return reached_.sorted(); }
  /// The voxels of some bricks. `load(id, box)` gives a submap's. What lies together should be asked for together.
  [[nodiscard]] BrickTree make(std::span<const Brick> bricks, const LoadSubmap& load);

 private:
  struct Submap {
    PlacedSubmap placed;
    BrickBox reached;                 // of the world
    std::vector<PlacedBrick> bricks;  // of one that was used a short time ago
    std::uint64_t last_use = 0;
  };
  /// Those that reach into a box of the world, by their numbers, with their bricks in memory.
  [[nodiscard]] std::vector<const Submap*> reaching(const BrickBox& box);
  double brick_size_;
  Merger merger_;
  std::vector<Submap> submaps_;
  BrickSet reached_;
  std::uint64_t use_ = 0;
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
