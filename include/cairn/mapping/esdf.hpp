// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "cairn/mapping/options.hpp"

namespace cairn {

/// Euclidean signed distance field: distance to the nearest surface, positive in front of it, negative behind. World
/// frame, meters. Immutable: a map update creates a new field that shares the unchanged blocks. Safe to query from any
/// number of threads.
class DistanceField {
 public:
  /// Samples of 16x16x16 voxels, x * 256 + y * 16 + z; NaN: not observed.
  using Block = std::array<float, 4096>;
  struct PlacedBlock {
    Eigen::Vector3i index;  ///< block (i, j, k)
    std::shared_ptr<const Block> samples;
  };
  using Blocks = std::vector<PlacedBlock>;

  struct Answer {
    bool known = false;                                  ///< false: unobserved, or outside the map
    float distance = 0.0f;                               ///< meters, clamped to max_distance()
    Eigen::Vector3f gradient = Eigen::Vector3f::Zero();  ///< gradient of the distance, unit length: points away from
                                                         ///< the nearest surface in front of it; zero where the
                                                         ///< distance is clamped
  };

  /// Block (i, j, k) starts with voxel 16 (i, j, k); voxel (i, j, k) samples the point world_from_field * (origin +
  /// voxel_size * (i, j, k)). Memory is proportional to the number of blocks, not to the bounding box. Throws
  /// std::invalid_argument for a block with voxel indices beyond 32 bits.
  DistanceField(float voxel_size, const Eigen::Vector3f& origin, float max_distance, Blocks blocks,
                const Eigen::Quaternionf& world_from_field = Eigen::Quaternionf::Identity());
  /// Reads the grid `esdf` written by write_grids or `cairn esdf`. Throws std::runtime_error if it is missing.
  [[nodiscard]] static DistanceField read(const std::filesystem::path& vdb);

  /// Distances and gradients at points (meters), trilinearly interpolated. NaN points and points outside the map are
  /// unknown. `answers` has the size of `points`. Uses all cores.
  void query(std::span<const Eigen::Vector3f> points, std::span<Answer> answers) const;
  /// Same query with the results as separate arrays; unknown distances are NaN.
  void query(std::span<const Eigen::Vector3f> points, std::span<float> distances, std::span<Eigen::Vector3f> gradients,
             std::span<bool> known) const;
  [[nodiscard]] Answer query(const Eigen::Vector3f& point) const;

  [[nodiscard]] float voxel_size() const { return voxel_size_; }
  [[nodiscard]] float max_distance() const { return max_distance_; }
  [[nodiscard]] const Eigen::Vector3f& origin() const { return origin_; }  ///< in the field's own frame
  [[nodiscard]] const Eigen::Quaternionf& world_from_field() const { return world_from_field_; }
  /// Point in the world frame of a (fractional) voxel index.
  [[nodiscard]] Eigen::Vector3f point(const Eigen::Vector3f& voxel) const {
    return world_from_field_ * (origin_ + voxel_size_ * voxel);
  }
  [[nodiscard]] const Blocks& blocks() const { return blocks_; }
  /// Voxel index of sample number `sample` of a block; z varies fastest.
  [[nodiscard]] static Eigen::Vector3i voxel(const Eigen::Vector3i& block, int sample) {
    return 16 * block + Eigen::Vector3i(sample >> 8, sample >> 4 & 15, sample & 15);
  }
  /// Bounding box of all known voxels, meters; empty without known voxels.
  [[nodiscard]] Eigen::AlignedBox3f bounds() const;

 private:
  [[nodiscard]] const Block* block_of(const Eigen::Vector3i& voxel) const;  ///< null: unknown
  [[nodiscard]] float at(const Eigen::Vector3i& voxel) const;               ///< NaN: unknown

  float voxel_size_;
  Eigen::Vector3f origin_;
  float max_distance_;
  Blocks blocks_;
  Eigen::Quaternionf world_from_field_;
  Eigen::Vector3i first_ = Eigen::Vector3i::Zero(), size_ = Eigen::Vector3i::Zero();  ///< bounding box, in blocks
  std::vector<const Block*> table_;  ///< dense lookup over the box, null: unknown; empty if the box is too sparse
  std::vector<std::pair<std::array<int, 3>, const Block*>> sorted_;  ///< used in place of the table for a sparse box
};

/// Writes the grid `esdf` to a .vdb file atomically (meters; active voxels are known).
void write_distances(const std::filesystem::path& vdb, const DistanceField& distances);

/// Reads query points from a CSV file with the header x,y,z and three numbers per line, meters (nan is valid). Throws
/// std::runtime_error with file and line.
[[nodiscard]] std::vector<Eigen::Vector3f> read_query_points(const std::filesystem::path& file);

}  // namespace cairn
