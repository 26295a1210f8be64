// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/trajectory.hpp"
#include "shaders/esdf.h"
#include "volume/volume.hpp"

namespace cairn {

/// How many voxels of the TSDF a voxel of the distance field is wide. Throws std::runtime_error when that is not 1, 2,
/// 4 or 8.
[[nodiscard]] int esdf_scale(const FuseOptions& fuse, const EsdfOptions& options);

/// EsdfOptions::robot_radius, or a little more, so that a voxel of the field lies within it.
[[nodiscard]] float free_radius(const FuseOptions& fuse, const EsdfOptions& options);

/// The Euclidean signed distance field of a map, on the device. Each voxel knows the nearest site: a voxel that the
/// surface passes, and where it lies there. An update finds the sites in the bricks that changed; where one came, a
/// wave lowers the distances around it, and where one went or moved, those that came from it are raised first (Lau et
/// al. 2013, Oleynikova et al. 2017; the wave is vector propagation after Danielsson 1980).
class Esdf {
 public:
  /// Throws std::runtime_error when the voxel size is not 1, 2, 4 or 8 voxels of the TSDF.
  /// A field of more voxels than `most_texels` is read by address; 0: as the device says.
  Esdf(gpu::Device& device, const FuseOptions& fuse, const EsdfOptions& options, std::uint64_t most_texels = 0);

  struct Updated {
    int sites = 0;   // voxels in which a site came, went or moved
    int voxels = 0;  // that found another nearest site, counted once a step
    int steps = 0;   // of the wave
    bool rebuilt = false;
  };
  /// Brings the field up to date with bricks of the map that have changed, come, or gone. Sites that moved by less than
  /// a quarter of a voxel stay where they are: by so much the result may differ from a field made anew, and by more
  /// only where a site nearly as near was found. It is made anew, with the same bits each time, when most of it is new.
  Updated update(const Volume& volume, std::span<const Brick> changed);
  /// `also_free`: knows more to be free than the map does.
  Updated update(const BrickTree& map, std::span<const Brick> changed, const BrickTree* also_free = nullptr);
  /// Forgets all distances and finds them again from the sites.
  Updated rebuild();

  /// The field as it is; voxels that did not change since the last call are shared with its answer.
  [[nodiscard]] std::shared_ptr<const DistanceField> field();
  [[nodiscard]] float voxel_size() const { return voxel_size_; }         // metres
  [[nodiscard]] std::size_t blocks() const { return block_of_.size(); }  // of 16x16x16 voxels

 private:
  using Block = Eigen::Vector3i;  // voxel / 16
  struct Kernels {
    Kernels(gpu::Device& device, bool in_texels);
    bool in_texels;  // or the field and the volume are read by address
    gpu::Kernel<shader::EsdfSitesPush> sites;
    gpu::Kernel<shader::EsdfCheckPush> check;
    gpu::Kernel<shader::EsdfWavePush> raise, settle, lower;
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
  Updated spread(gpu::Batch& batch, bool restart);
  [[nodiscard]] bool transform(Updated& updated);
  void transform(const Eigen::AlignedBox3i& box, const Eigen::AlignedBox3i& asked, const gpu::Buffer (&cells)[2],
                 const gpu::Buffer& stack);
  [[nodiscard]] bool run_waves(gpu::Batch& batch, Updated& updated);
  [[nodiscard]] shader::EsdfView view() const;

  gpu::Device& device_;
  FuseOptions fuse_;
  EsdfOptions options_;
  int scale_;         // TSDF voxels a voxel
  float voxel_size_;  // metres
  std::uint64_t most_texels_;
  std::optional<Kernels> kernels_;

  std::uint32_t capacity_ = 0, table_bits_ = 0, list_capacity_ = 0;  // blocks; voxels
  gpu::Buffer nearest_, surface_, blocks_, table_, dirty_, list_[2], counts_, removed_, jobs_, voxels_, free_,
      check_list_, distances_;
  std::vector<Block> block_of_;  // by slot
  std::unordered_map<Block, std::uint32_t, BrickHash> slot_of_;
  std::unordered_set<Block, BrickHash> known_, near_;         // with observed voxels; these and what lies around them
  std::unordered_map<Block, int, BrickHash> unknown_around_;  // blocks not in near_; missing: all
  Eigen::AlignedBox3i box_;                                   // of all blocks
  std::size_t settled_ = 0;                                   // blocks below it took part in a wave
  std::vector<std::shared_ptr<const DistanceField::Block>> samples_;  // by slot
};

/// The field of a whole map on the host, with free_radius() around each pose of `visited` free. `box`: that all of the
/// map's bricks lie in, of a part of a map; what is free around poses is left out beyond it.
[[nodiscard]] std::shared_ptr<const DistanceField> distances_of(gpu::Device& device, const BrickTree& map,
                                                                const FuseOptions& fuse, const EsdfOptions& options,
                                                                const Trajectory& visited = {},
                                                                const std::optional<BrickBox>& box = {});

}  // namespace cairn
