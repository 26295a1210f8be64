// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The only door to OpenVDB.
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

/// The order of lists of bricks: by x, then y, then z.
[[nodiscard]] inline bool before(const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Voxels of one brick in OpenVDB's leaf order, see shaders/voxel.h.
using BrickVoxels = std::array<std::uint64_t, 512>;

/// A bit for each voxel of a brick, in the same order: bit i % 64 of word i / 64.
using BrickBits = std::array<std::uint64_t, 8>;
inline constexpr BrickBits kNoBits{}, kAllBits{~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull, ~0ull};

struct BrickMarks {
  std::vector<Eigen::Vector3i> bricks;
  std::vector<BrickBits> voxels;  // of each
};
/// The voxels of a ball, and their bricks. `centre` and `radius` in voxels.
[[nodiscard]] BrickMarks ball(const Eigen::Vector3d& centre, double radius);

/// Bricks from one corner to the other, both of them within.
using BrickBox = Eigen::AlignedBox3i;

struct GridInfo;

/// Bricks on the host: an OpenVDB tree with one leaf a brick. Beside it, a bit a voxel, what was seen to be free, in
/// bricks with voxels as well: of a voxel that was observed, its distance tells, else its bit.
class BrickTree {
 public:
  BrickTree();
  ~BrickTree();
  BrickTree(BrickTree&&) noexcept;
  [[nodiscard]] BrickTree copy() const;
  BrickTree& operator=(BrickTree&&) noexcept;
  [[nodiscard]] BrickTree copy_free() const;  // what is free, without voxels

  /// Adds the brick or replaces it. `brick` counts bricks: voxel / 8.
  void put(const Eigen::Vector3i& brick, std::span<const std::uint64_t, 512> voxels);
  void erase(const Eigen::Vector3i& brick);  // what is free stays
  /// Notes that voxels were seen to be free. Returns whether that is new of some.
  bool mark_free(const Eigen::Vector3i& brick, const BrickBits& voxels = kAllBits);
  void forget_free();
  /// Takes over what another tree knows to be free, and forgets what it knew itself.
  void take_free(BrickTree&& other);
  /// Whether all of a brick is free, and has no voxels.
  [[nodiscard]] bool is_free(const Eigen::Vector3i& brick) const;
  [[nodiscard]] BrickBits free_voxels(const Eigen::Vector3i& brick) const;
  /// Those with a free voxel, sorted like bricks().
  [[nodiscard]] std::vector<Eigen::Vector3i> free_bricks() const;
  /// These and their free voxels in the tree's own order, which takes less time.
  void visit_free(const std::function<void(const Eigen::Vector3i&, const BrickBits&)>& visit) const;
  /// The brick's voxels, or null. Valid until the brick is put again.
  [[nodiscard]] const std::uint64_t* find(const Eigen::Vector3i& brick) const;
  [[nodiscard]] std::size_t size() const;  // bricks
  /// All bricks, sorted by x, then y, then z.
  [[nodiscard]] std::vector<Eigen::Vector3i> bricks() const;
  void visit(const std::function<void(const Eigen::Vector3i&)>& visit) const;  // in the tree's own order

 private:
  friend void write_bricks(const std::filesystem::path& file, const BrickTree& tree);
  friend void write_bricks(const std::filesystem::path& file, const struct BrickList& list);
  friend class BrickFile;
  friend class GridsWriter;
  struct State;
  std::unique_ptr<State> state_;
};

/// Bricks that are kept for a moment: one large piece of memory, which goes back to the system as a whole, where a tree
/// takes a small one for each.
struct BrickList {
  std::vector<Eigen::Vector3i> bricks;  // each once
  std::vector<BrickVoxels> voxels;      // of each
  BrickTree free;                       // what is free, without voxels
};

[[nodiscard]] BrickList list_of(const BrickTree& tree);
[[nodiscard]] BrickTree tree_of(const BrickList& list);

/// Writes bricks as they are (a grid of 64-bit voxels, and one of what is free): quick, for sessions. Whole or not at
/// all.
void write_bricks(const std::filesystem::path& file, const BrickTree& tree);
void write_bricks(const std::filesystem::path& file, const BrickList& list);

/// A file of write_bricks, out of which some bricks are read at a time. Files of versions before 2026-11-24 hold one
/// grid, with tiles for bricks that are free as a whole.
class BrickFile {
 public:
  /// Finds where the bricks are. Throws std::runtime_error for a file that is missing or broken.
  explicit BrickFile(std::filesystem::path file);
  [[nodiscard]] std::vector<Eigen::Vector3i> bricks() const;  // sorted by x, then y, then z
  /// Throws std::runtime_error where voxels cannot be read.
  void check() const;
  /// All of it. Throws std::runtime_error as above, as those below do.
  [[nodiscard]] BrickTree read() const;
  /// The bricks in a box; of what is free, bricks that are so as a whole.
  [[nodiscard]] BrickTree read(const BrickBox& box) const;
  /// What is free, without voxels.
  [[nodiscard]] BrickTree read_free() const;

 private:
  struct Place {
    Eigen::Vector3i brick;
    std::int64_t offset;  // bytes from the file's beginning
  };
  template <class Visit>
  void visit(const std::optional<BrickBox>& box, const Visit& visit) const;
  std::filesystem::path file_;
  std::uint32_t version_ = 0, compression_ = 0;  // of OpenVDB's format
  std::vector<Place> places_;                    // in the file's order
  std::vector<Eigen::Vector3i> free_;            // as a whole, sorted
  std::int64_t free_grid_ = 0;                   // bytes from the file's beginning; 0: it has none
};

/// What a map.vdb needs beside its voxels.
struct GridInfo {
  float voxel_size = 0.0f;  // metres
  float truncation = 0.0f;  // metres
  Upright upright;          // how the voxels' own frame lies in the world
  Axes axes = Axes::world;  // of the file, which its grids' transforms turn to
  SurfaceSigma sigma;       // in the voxels' own frame; empty: not known
};

/// The order in which a grid keeps its bricks: by cubes of 512 bricks a side, then by cubes of 16, then by brick, each
/// by x, then y, then z.
[[nodiscard]] bool before_in_grid(const Eigen::Vector3i& a, const Eigen::Vector3i& b);

/// Writes the grids `tsdf` (float, metres, level set), `weight` (float), `colour` (vec3f, 0..1, sRGB) and
/// `colour_weight` (float: frames), active where the weight is not 0, and `observed` and `free` (bool), active at the
/// lowest corner of whole_cells and where a voxel was seen to be free. Inactive voxels of `tsdf` are with_unknown, and
/// tiles behind_beside. Where it is known also `sigma` (float, metres), a voxel for each cell of SurfaceSigma. Whole or
/// not at all. The map comes part by part: what was added waits on the disk, packed.
/// Throws std::runtime_error.
class GridsWriter {
 public:
  GridsWriter(std::filesystem::path file, const GridInfo& info);
  ~GridsWriter();
  /// Adds bricks that come after those of earlier calls, see before_in_grid.
  void add(const BrickTree& bricks);
  /// Writes the file, with what `free` knows to be free. With `distances` also the grid `esdf`, see write_distances in
  /// cairn/esdf.hpp.
  void write(const BrickTree& free, const DistanceField* distances);

 private:
  struct State;
  std::unique_ptr<State> state_;
};
/// All of a map at once.
void write_grids(const std::filesystem::path& file, const BrickTree& tree, const GridInfo& info,
                 const DistanceField* distances = nullptr);

/// A map.vdb without its colours, brick by brick: its voxels need not all be in memory.
class MapFile {
 public:
  /// Finds its bricks. Throws std::runtime_error when the file is not a Cairn map.
  explicit MapFile(const std::filesystem::path& file);
  ~MapFile();
  [[nodiscard]] const GridInfo& info() const;
  /// Around all that visit() tells of; empty where that is nothing.
  [[nodiscard]] BrickBox bounds() const;

  /// A brick's voxels in OpenVDB's leaf order.
  struct Voxels {
    std::array<float, 512> distances{}, weights{};  // metres, and observations; both 0 where there are none
    BrickBits free{};                               // of the voxels without observations, those seen to be free
  };
  using Visit = std::function<void(const Eigen::Vector3i& brick, const Voxels& voxels)>;
  /// All bricks, or those of a box, that hold observations or free voxels, once. Throws std::runtime_error where voxels
  /// cannot be read.
  void visit(const Visit& visit, const std::optional<BrickBox>& box = {}) const;
  /// Adds the bricks of a box to a tree, without colours. Throws as visit() does.
  void read(const BrickBox& box, BrickTree& tree) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

struct ReadGrids {
  BrickTree tree;
  GridInfo info;
};
/// Reads what GridsWriter wrote; distances and colours come back as they were. Throws std::runtime_error when the file
/// is not a Cairn map.
[[nodiscard]] ReadGrids read_grids(const std::filesystem::path& file);

}  // namespace cairn
