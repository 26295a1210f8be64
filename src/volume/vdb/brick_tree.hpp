// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Brick tree: voxels and free space in memory, by bricks of 8 x 8 x 8 voxels.
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace cairn {

/// Order of brick lists: by x, then y, then z.
[[nodiscard]] inline bool before(const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Order of bricks in a grid: by cubes of 512 bricks per side, then by cubes of 16, then by brick, each by x, then y,
/// then z.
[[nodiscard]] bool before_in_grid(const Eigen::Vector3i& a, const Eigen::Vector3i& b);

/// Voxels of one brick in OpenVDB's leaf order, see shaders/voxel.h.
using BrickVoxels = std::array<std::uint64_t, 512>;

/// Bit mask of a brick's voxels, in the same order: bit i % 64 of word i / 64.
using BrickBits = std::array<std::uint64_t, 8>;
inline constexpr BrickBits kNoBits{}, kAllBits{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};

struct BrickMarks {
  std::vector<Eigen::Vector3i> bricks;
  std::vector<BrickBits> voxels;  // by brick
};
/// Voxels of a ball, by brick. `center` and `radius` in voxels.
[[nodiscard]] BrickMarks ball(const Eigen::Vector3d& center, double radius);

/// Box of bricks; both corners are inclusive.
using BrickBox = Eigen::AlignedBox3i;

/// Bricks on the host: an OpenVDB tree with a leaf per brick. Free space is stored separately as a bit per voxel, also
/// for bricks with voxels: the distance of an observed voxel overrides its bit.
class BrickTree {
 public:
  BrickTree();
  ~BrickTree();
  BrickTree(BrickTree&&) noexcept;
  [[nodiscard]] BrickTree copy() const;
  BrickTree& operator=(BrickTree&&) noexcept;
  [[nodiscard]] BrickTree copy_free() const;  // free space only, without voxels

  /// Inserts or replaces the brick. `brick`: brick coordinates, voxel / 8.
  void put(const Eigen::Vector3i& brick, std::span<const std::uint64_t, 512> voxels);
  void erase(const Eigen::Vector3i& brick);  // keeps its free space
  /// Marks voxels as free. Returns true if any of them is new.
  bool mark_free(const Eigen::Vector3i& brick, const BrickBits& voxels = kAllBits);
  void forget_free();
  /// Takes over the free space of another tree; discards its own.
  void take_free(BrickTree&& other);
  /// True if the complete brick is free and has no voxels.
  [[nodiscard]] bool is_free(const Eigen::Vector3i& brick) const;
  [[nodiscard]] BrickBits free_voxels(const Eigen::Vector3i& brick) const;
  /// Bricks with a free voxel, sorted like bricks().
  [[nodiscard]] std::vector<Eigen::Vector3i> free_bricks() const;
  /// Visits the free bricks and their free voxels in tree order, which is faster.
  void visit_free(const std::function<void(const Eigen::Vector3i&, const BrickBits&)>& visit) const;
  /// The brick's voxels, or null. Valid until the next put() of the brick.
  [[nodiscard]] const std::uint64_t* find(const Eigen::Vector3i& brick) const;
  [[nodiscard]] std::size_t size() const;  // bricks
  /// All bricks, sorted by x, then y, then z.
  [[nodiscard]] std::vector<Eigen::Vector3i> bricks() const;
  void visit(const std::function<void(const Eigen::Vector3i&)>& visit) const;  // in tree order

 private:
  friend void write_bricks(const std::filesystem::path& file, const BrickTree& tree);
  friend void write_bricks(const std::filesystem::path& file, const struct BrickList& list);
  friend class BrickFile;
  friend class GridsWriter;
  struct State;
  std::unique_ptr<State> state_;
};

/// Short-lived copy of bricks in a single large allocation, returned to the system at once; a tree allocates each brick
/// separately.
struct BrickList {
  std::vector<Eigen::Vector3i> bricks;  // unique
  std::vector<BrickVoxels> voxels;      // by brick
  BrickTree free;                       // free space only, without voxels
};

[[nodiscard]] BrickTree tree_of(const BrickList& list);

}  // namespace cairn
