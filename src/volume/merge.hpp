// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "volume/volume.hpp"

namespace cairn {

/// What a brick of the world takes from one submap.
struct MergeShare {
  std::size_t submap = 0;                                               // index among those given
  Eigen::Isometry3d submap_from_world = Eigen::Isometry3d::Identity();  // metres, at this brick
};
struct MergeJob {
  Brick target;
  std::vector<MergeShare> shares;
};

/// Gives a submap's voxels: those of a box at least.
using LoadSubmap = std::function<std::shared_ptr<const BrickTree>(std::size_t submap, const BrickBox& box)>;

/// Fuses submaps into bricks of the world on the device: weighted means of resampled voxels.
class Merger {
 public:
  Merger(gpu::Device& device, const FuseOptions& options);
  /// Puts the jobs' bricks into `world`; those without any observed voxel are erased from it. `submap` is called from
  /// one thread at a time. Jobs that lie together should follow each other.
  void merge(std::span<const MergeJob> jobs, const LoadSubmap& submap, BrickTree& world);

 private:
  /// Jobs of one dispatch.
  struct Gathered {
    std::size_t begin = 0, end = 0;
    std::vector<shader::MergeTarget> targets;
    std::vector<shader::MergeSource> sources;
    std::vector<BrickVoxels> voxels;  // by slot
    std::uint32_t used = 0;           // slots
  };
  void gather(std::span<const MergeJob> jobs, std::size_t begin, const LoadSubmap& submap, Gathered& to) const;

  gpu::Device& device_;
  FuseOptions options_;
  gpu::Kernel<shader::SubmapMergePush> merge_;
};

}  // namespace cairn
