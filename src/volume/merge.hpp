// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "volume/volume.hpp"

namespace cairn {

/// Contribution of a submap to an output brick.
struct MergeShare {
  std::size_t submap = 0;                                               // index of the submap
  Eigen::Isometry3d submap_from_world = Eigen::Isometry3d::Identity();  // meters; valid at this brick
};
struct MergeJob {
  Brick target;
  std::vector<MergeShare> shares;
};

/// Loads the voxels of a submap, at least within the box.
using LoadSubmap = std::function<std::shared_ptr<const BrickTree>(std::size_t submap, const BrickBox& box)>;

/// Fuses submaps into world bricks on the device: weighted means of resampled voxels.
class Merger {
 public:
  Merger(gpu::Device& device, const FuseOptions& options);
  /// Writes the jobs' bricks to `world`; erases bricks without an observed voxel. `submap` is called from a single
  /// thread at a time. Spatially adjacent jobs should be consecutive.
  void merge(std::span<const MergeJob> jobs, const LoadSubmap& submap, BrickTree& world);

 private:
  /// Jobs of a dispatch.
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
