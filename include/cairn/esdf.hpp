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

#include "cairn/options.hpp"

namespace cairn {

/// Signed Euclidean distances to the nearest surface: positive in front of it, negative behind. World frame, metres. A
/// field never changes: what updates the map makes a new one, which shares what stayed. Any number of threads may ask.
class DistanceField {
 public:
  /// Samples of 16x16x16 voxels, x * 256 + y * 16 + z; NaN where nothing was observed.
  using Block = std::array<float, 4096>;
  using Blocks = std::vector<std::pair<Eigen::Vector3i, std::shared_ptr<const Block>>>;

  struct Answer {
    bool known = false;     ///< false: nobody has seen this place, or it lies outside the map
    float distance = 0.0f;  ///< metres; at most max_distance(), which also stands for "farther"
    Eigen::Vector3f gradient = Eigen::Vector3f::Zero();  ///< of the distance, unit length: away from the nearest
                                                         ///< surface in front of it; zero where everything is far
  };

  /// Block (i, j, k) starts with voxel 16 (i, j, k); voxel (i, j, k) samples the point world_from_field
  /// * (origin + voxel_size * (i, j, k)). Memory follows the number of blocks, not the box around them. Throws
  /// std::invalid_argument for a block whose voxels 32 bits do not number.
  DistanceField(float voxel_size, const Eigen::Vector3f& origin, float max_distance, Blocks blocks,
                const Eigen::Quaternionf& world_from_field = Eigen::Quaternionf::Identity());
  /// Reads the grid `esdf` that write_grids or `cairn esdf` wrote. Throws std::runtime_error if there is none.
  [[nodiscard]] static DistanceField read(const std::filesystem::path& vdb);

  /// Distances and directions at points (metres), interpolated between the voxels around them (trilinear). NaN and
  /// points outside the map are unknown. `answers` is of the size of `points`. Uses all cores.
  void query(std::span<const Eigen::Vector3f> points, std::span<Answer> answers) const;
  /// The same, each part of the answers by itself; the distance of what is unknown is NaN.
  void query(std::span<const Eigen::Vector3f> points, std::span<float> distances, std::span<Eigen::Vector3f> gradients,
             std::span<bool> known) const;
  [[nodiscard]] Answer query(const Eigen::Vector3f& point) const;

  [[nodiscard]] float voxel_size() const { return voxel_size_; }
  [[nodiscard]] float max_distance() const { return max_distance_; }
  [[nodiscard]] const Eigen::Vector3f& origin() const { return origin_; }  ///< in the field's own frame
  [[nodiscard]] const Eigen::Quaternionf& world_from_field() const { return world_from_field_; }
  /// The point in the world that lies at a place among the voxels.
  [[nodiscard]] Eigen::Vector3f point(const Eigen::Vector3f& voxel) const {
    return world_from_field_ * (origin_ + voxel_size_ * voxel);
  }
  [[nodiscard]] const Blocks& blocks() const { return blocks_; }
  /// The voxel that is number `sample` of a block: z runs fastest.
  [[nodiscard]] static Eigen::Vector3i voxel(const Eigen::Vector3i& block, int sample) {
    return 16 * block + Eigen::Vector3i(sample >> 8, sample >> 4 & 15, sample & 15);
  }
  /// Around all known voxels, metres; empty if there are none.
  [[nodiscard]] Eigen::AlignedBox3f bounds() const;

 private:
  [[nodiscard]] const Block* block_of(const Eigen::Vector3i& voxel) const;  ///< null: nothing known
  [[nodiscard]] float at(const Eigen::Vector3i& voxel) const;               ///< NaN: unknown

  float voxel_size_;
  Eigen::Vector3f origin_;
  float max_distance_;
  Blocks blocks_;
  Eigen::Quaternionf world_from_field_;
  Eigen::Vector3i first_ = Eigen::Vector3i::Zero(), size_ = Eigen::Vector3i::Zero();  ///< of the box, blocks
  std::vector<const Block*> table_;  ///< of the box, null: nothing known; empty where the blocks fill too little of it
  std::vector<std::pair<std::array<int, 3>, const Block*>> sorted_;  ///< in place of that table
};

/// Writes the grid `esdf` to a .vdb file (metres; active where known), whole or not at all.
void write_distances(const std::filesystem::path& vdb, const DistanceField& distances);

/// Points to ask for, from a CSV file with the header x,y,z and three numbers a line, metres (nan is one). Throws
/// std::runtime_error with file and line.
[[nodiscard]] std::vector<Eigen::Vector3f> read_query_points(const std::filesystem::path& file);

}  // namespace cairn
