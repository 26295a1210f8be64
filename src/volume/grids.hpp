// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The only header through which OpenVDB is used.
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/mesh.hpp"
#include "cairn/surface_sigma.hpp"
#include "cairn/upright.hpp"

namespace cairn {

/// Order of brick lists: by x, then y, then z.
[[nodiscard]] inline bool before(const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Voxels of one brick in OpenVDB's leaf order, see shaders/voxel.h.
using BrickVoxels = std::array<std::uint64_t, 512>;

/// Bit mask of a brick's voxels, in the same order: bit i % 64 of word i / 64.
using BrickBits = std::array<std::uint64_t, 8>;
inline constexpr BrickBits kNoBits{}, kAllBits{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};

struct BrickMarks {
  std::vector<Eigen::Vector3i> bricks;
  std::vector<BrickBits> voxels;  // by brick
};
/// Voxels of a ball, by brick. `centre` and `radius` in voxels.
[[nodiscard]] BrickMarks ball(const Eigen::Vector3d& centre, double radius);

/// Box of bricks; both corners are inclusive.
using BrickBox = Eigen::AlignedBox3i;

struct GridInfo;

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

[[nodiscard]] BrickList list_of(const BrickTree& tree);
[[nodiscard]] BrickTree tree_of(const BrickList& list);

/// Writes bricks unchanged (a grid of 64-bit voxels, and a grid of free space): fast, for sessions. Atomic.
void write_bricks(const std::filesystem::path& file, const BrickTree& tree);
void write_bricks(const std::filesystem::path& file, const BrickList& list);

/// Random access to the bricks of a write_bricks file. Files from before 2026-11-24 have a single grid, with tiles for
/// completely free bricks.
class BrickFile {
 public:
  /// Reads the offsets of the bricks. Throws std::runtime_error if the file is missing or corrupt.
  explicit BrickFile(std::filesystem::path file);
  [[nodiscard]] std::vector<Eigen::Vector3i> bricks() const;  // sorted by x, then y, then z
  /// Throws std::runtime_error if voxels cannot be read.
  void check() const;
  /// Reads the complete file. Throws std::runtime_error as above, as do the functions below.
  [[nodiscard]] BrickTree read() const;
  /// Reads the bricks in a box; of free space, only completely free bricks.
  [[nodiscard]] BrickTree read(const BrickBox& box) const;
  /// Reads the free space, without voxels.
  [[nodiscard]] BrickTree read_free() const;

 private:
  struct Place {
    Eigen::Vector3i brick;
    std::int64_t offset;  // bytes from the start of the file
  };
  template <class Visit>
  void visit(const std::optional<BrickBox>& box, const Visit& visit) const;
  std::filesystem::path file_;
  std::uint32_t version_ = 0, compression_ = 0;  // of the OpenVDB format
  std::vector<Place> places_;                    // in file order
  std::vector<Eigen::Vector3i> free_;            // completely free bricks, sorted
  std::int64_t free_grid_ = 0;                   // bytes from the start of the file; 0: no free grid
};

/// Metadata of a map.vdb.
struct GridInfo {
  float voxel_size = 0.0f;  // meters
  float truncation = 0.0f;  // meters
  Upright upright;          // gravity direction, and rotation from the voxel frame to the world
  Axes axes = Axes::world;  // axes of the file; the grid transforms rotate to them
  SurfaceSigma sigma;       // in the voxel frame; empty: unknown
};

/// Order of bricks in a grid: by cubes of 512 bricks per side, then by cubes of 16, then by brick, each by x, then y,
/// then z.
[[nodiscard]] bool before_in_grid(const Eigen::Vector3i& a, const Eigen::Vector3i& b);

/// Writes the grids of a map.vdb: `tsdf` (float, meters, level set), `weight` (float), `colour` (vec3f, 0..1, sRGB) and
/// `colour_weight` (float, frames), active where the weight is not 0; `observed` and `free` (bool), active at the
/// lowest corner of each cell of whole_cells and at free voxels. Inactive voxels of `tsdf` have the signs of
/// with_unknown, inactive tiles those of behind_beside. If known, `sigma` (float, meters) has one voxel per cell of
/// SurfaceSigma. Atomic. The map is added in parts, which are stored packed on disk until write(). Throws
/// std::runtime_error.
class GridsWriter {
 public:
  GridsWriter(std::filesystem::path file, const GridInfo& info);
  ~GridsWriter();
  /// Adds bricks. They must follow the bricks of earlier calls in the order of before_in_grid.
  void add(const BrickTree& bricks);
  /// Writes the file, with the free space of `free`. With `distances`, also writes the grid `esdf`; see write_distances
  /// in cairn/esdf.hpp.
  void write(const BrickTree& free, const DistanceField* distances);

 private:
  struct State;
  std::unique_ptr<State> state_;
};
/// Writes a complete map at once.
void write_grids(const std::filesystem::path& file, const BrickTree& tree, const GridInfo& info,
                 const DistanceField* distances = nullptr);

/// A map.vdb without its colors, read brick by brick: its voxels need not fit into memory.
class MapFile {
 public:
  /// Reads the offsets of the bricks. Throws std::runtime_error if the file is not a Cairn map.
  explicit MapFile(const std::filesystem::path& file);
  ~MapFile();
  [[nodiscard]] const GridInfo& info() const;
  /// Bounds of all bricks reported by visit(); empty for an empty map.
  [[nodiscard]] BrickBox bounds() const;

  /// Voxels of a brick in OpenVDB's leaf order.
  struct Voxels {
    std::array<float, 512> distances{}, weights{};  // meters; number of observations; both 0 if unobserved
    BrickBits free{};                               // free voxels without observations
  };
  using Visit = std::function<void(const Eigen::Vector3i& brick, const Voxels& voxels)>;
  /// Visits all bricks, or those in a box, with observations or free voxels, each once. Throws std::runtime_error if
  /// voxels cannot be read.
  void visit(const Visit& visit, const std::optional<BrickBox>& box = {}) const;
  /// Adds the bricks of a box to a tree, without colors. Throws like visit().
  void read(const BrickBox& box, BrickTree& tree) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

struct ReadGrids {
  BrickTree tree;
  GridInfo info;
};
/// Reads a file of GridsWriter; distances and colors are restored exactly. Throws std::runtime_error if the file is not
/// a Cairn map.
[[nodiscard]] ReadGrids read_grids(const std::filesystem::path& file);

}  // namespace cairn
