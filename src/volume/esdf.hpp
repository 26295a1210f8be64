// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "shaders/esdf.h"
#include "volume/volume.hpp"

namespace cairn {

/// Size of an ESDF voxel in TSDF voxels. Throws std::runtime_error unless 1, 2, 4 or 8.
[[nodiscard]] int esdf_scale(const FuseOptions& fuse, const EsdfOptions& options);

/// EsdfOptions::robot_radius, enlarged if necessary to contain a voxel of the field; meters.
[[nodiscard]] float free_radius(const FuseOptions& fuse, const EsdfOptions& options);

/// Euclidean signed distance field of a map, on the device. Each voxel stores its nearest site: a voxel crossed by the
/// surface, with the surface position in it. An update finds the sites of changed bricks and runs the two wavefronts of
/// the dynamic brushfire (Lau et al. 2013, Oleynikova et al. 2017): raise clears distances to removed or moved sites,
/// lower propagates nearer sites (vector propagation: Danielsson 1980).
class Esdf {
 public:
  /// Throws std::runtime_error unless the voxel size is 1, 2, 4 or 8 TSDF voxels. A field of more than `max_texels`
  /// voxels is read by address; 0: limit of the device.
  Esdf(gpu::Device& device, const FuseOptions& fuse, const EsdfOptions& options, std::uint64_t max_texels = 0);

  struct Updated {
    int sites = 0;   // voxels with an added, removed or moved site
    int voxels = 0;  // voxels with a new nearest site, counted once per step
    int steps = 0;   // wave steps
    bool rebuilt = false;
  };
  /// Updates the field with changed, new and removed bricks. Sites that moved by less than a quarter of a voxel keep
  /// their position. The result may differ from a rebuild by this distance, and by more only where a site at nearly the
  /// same distance was found. Rebuilds, deterministically to the bit, if most of the field is new.
  Updated update(const Volume& volume, std::span<const Brick> changed);
  /// `also_free`: free space in addition to the map's.
  Updated update(const BrickTree& map, std::span<const Brick> changed, const BrickTree* also_free = nullptr);
  /// Discards all distances and recomputes them from the sites.
  Updated rebuild();

  /// Current field; blocks unchanged since the last call are shared with its result.
  [[nodiscard]] std::shared_ptr<const DistanceField> field();
  [[nodiscard]] float voxel_size() const { return voxel_size_; }         // meters
  [[nodiscard]] std::size_t blocks() const { return block_of_.size(); }  // of 16x16x16 voxels

 private:
  using Block = Eigen::Vector3i;  // voxel / 16
  struct Kernels {
    Kernels(gpu::Device& device, bool in_texels);
    bool in_texels;  // false: the field and the volume are read by address
    gpu::Kernel<shader::EsdfSitesPush> sites;
    gpu::Kernel<shader::EsdfCheckPush> check;
    gpu::Kernel<shader::EsdfWavePush> raise, finalize, lower;
    gpu::Kernel<shader::EsdfDistancePush> distance;
    gpu::Kernel<shader::EsdfBoxPush> seed, nearest;
    gpu::Kernel<shader::EsdfLinesPush> lines;
  };
  Updated update(std::span<const Brick> changed, const Volume* volume, const BrickTree& map,
                 const BrickTree* also_free);
  void reserve(std::span<const shader::EsdfJob> jobs);
  void allocate(const std::vector<Block>& blocks);
  void resize(std::uint32_t capacity);
  void resize_lists(std::uint32_t capacity);
  void choose_kernels(bool is_volume_in_texels);
  void find_sites(gpu::Batch& batch, std::span<const shader::EsdfJob> jobs, const gpu::Buffer& voxels);
  [[nodiscard]] const gpu::Buffer* texels(const gpu::Buffer& buffer) const;
  Updated propagate(gpu::Batch& batch, bool restart);
  [[nodiscard]] bool transform(Updated& updated);
  void transform(const Eigen::AlignedBox3i& box, const Eigen::AlignedBox3i& target, const gpu::Buffer (&cells)[2],
                 const gpu::Buffer& stack);
  [[nodiscard]] bool run_waves(gpu::Batch& batch, Updated& updated);
  [[nodiscard]] shader::EsdfView view() const;

  gpu::Device& device_;
  FuseOptions fuse_;
  EsdfOptions options_;
  int scale_;         // TSDF voxels per ESDF voxel, along one axis
  float voxel_size_;  // meters
  std::uint64_t max_texels_;
  std::optional<Kernels> kernels_;

  std::uint32_t capacity_ = 0, table_bits_ = 0, list_capacity_ = 0;  // blocks; voxels
  gpu::Buffer nearest_, surface_, blocks_, table_, dirty_, list_[2], counts_, removed_, jobs_, voxels_, free_,
      check_list_, distances_;
  std::vector<Block> block_of_;  // by slot
  std::unordered_map<Block, std::uint32_t, BrickHash> slot_of_;
  std::unordered_set<Block, BrickHash> observed_, near_;  // blocks with observed voxels; these and their
                                                          // surroundings
  std::unordered_map<Block, int, BrickHash>
      unobserved_around_;       // number of surrounding blocks not in near_; missing: all
  Eigen::AlignedBox3i box_;     // bounds of all blocks
  std::size_t propagated_ = 0;  // blocks with a smaller slot took part in a wave
  std::vector<std::shared_ptr<const DistanceField::Block>> samples_;  // by slot
};

/// Field of a complete map on the host, with the ball of free_radius() around each pose of `visited`
/// (world_from_camera) marked as free. `box`: bounds of the bricks of a partial map; no pose marks free space outside.
[[nodiscard]] std::shared_ptr<const DistanceField> distances_of(gpu::Device& device, const BrickTree& map,
                                                                const FuseOptions& fuse, const EsdfOptions& options,
                                                                const Trajectory& visited = {},
                                                                const std::optional<BrickBox>& box = {});

}  // namespace cairn
