// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <vector>

#include "map/deform.hpp"
#include "volume/brick_set.hpp"
#include "volume/merge.hpp"

namespace cairn {

/// Submap with its pose in the world.
struct PlacedSubmap {
  std::size_t id = 0;                      // constant across updates; the submap's voxels never change
  std::shared_ptr<const BrickSet> bricks;  // with voxels
  Deformation deformation;
};

/// Submap brick with its pose in the world.
struct PlacedBrick {
  Brick brick;
  Eigen::Isometry3d world_from_submap;
};

/// Loads the free space of a submap, with or without its voxels.
using LoadFree = std::function<std::shared_ptr<const BrickTree>(std::size_t submap)>;

/// Free space of the world, without voxels: a voxel is free if the nearest voxel of a submap is.
[[nodiscard]] BrickTree free_space(const FuseOptions& options, const std::vector<PlacedSubmap>& submaps,
                                   const LoadFree& load);

/// Cell of the world, cell_of() of its bricks, with the submaps that contribute to its content.
struct ReachedCell {
  Brick cell;
  std::vector<std::size_t> submaps;  // ids, sorted
};
/// All cells of `side` bricks that contain a submap brick, sorted. Includes submaps within `margin` bricks of a cell.
[[nodiscard]] std::vector<ReachedCell> reached_cells(const FuseOptions& options,
                                                     const std::vector<PlacedSubmap>& submaps, int side, int margin);

/// The world in chunks, to process all of it with bounded memory: the set of bricks is known, and each brick is merged
/// on demand from the submaps that overlap it.
class GlobalVolumeChunks {
 public:
  GlobalVolumeChunks(gpu::Device& device, const FuseOptions& options, std::vector<PlacedSubmap> submaps);
  /// All world bricks that submaps with voxels overlap, sorted; some may turn out empty.
  [[nodiscard]] std::vector<Brick> bricks() const { return overlapped_.sorted(); }
  /// Voxels of some bricks. `load(id, box)` loads a submap's voxels. Adjacent bricks should be requested together.
  [[nodiscard]] BrickTree make(std::span<const Brick> bricks, const LoadSubmap& load);

 private:
  struct Submap {
    PlacedSubmap placed;
    BrickBox overlapped;              // of the world
    std::vector<PlacedBrick> bricks;  // of a recently used submap
    std::uint64_t last_use = 0;
  };
  /// Submaps that overlap a box of the world, by index, with their bricks in memory.
  [[nodiscard]] std::vector<const Submap*> overlapping(const BrickBox& box);
  double brick_size_;
  Merger merger_;
  std::vector<Submap> submaps_;
  BrickSet overlapped_;
  std::uint64_t use_ = 0;
};

/// Volume of the world: all submaps, at the poses and deformations of the pose graph.
class GlobalVolume {
 public:
  GlobalVolume(gpu::Device& device, const FuseOptions& options);
  /// Fuses changed regions again: bricks of submaps that are new, removed, or moved by more than a fraction of a voxel.
  /// `load(id)` loads a submap's voxels, `load_free(id)` its free space. Returns the merged bricks and the bricks whose
  /// free space changed, sorted.
  std::vector<Brick> update(const std::vector<PlacedSubmap>& submaps, const LoadSubmap& load,
                            const LoadFree& load_free);
  [[nodiscard]] const BrickTree& bricks() const { return bricks_; }
  /// Moves the bricks out; the world is empty afterwards.
  [[nodiscard]] BrickTree release();

 private:
  [[nodiscard]] std::vector<Brick> replace_free_space(BrickTree free);
  FuseOptions options_;
  Merger merger_;
  BrickTree bricks_;
  std::vector<std::vector<PlacedBrick>> placements_;  // by submap, as last fused
};

}  // namespace cairn
