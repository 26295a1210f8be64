// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// map.vdb: OpenVDB grids of a map, for other programs and to continue a map.
#pragma once
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/gravity_alignment.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/surface_sigma.hpp"
#include "volume/vdb/brick_tree.hpp"

namespace cairn {

/// Metadata of a map.vdb.
struct GridInfo {
  float voxel_size = 0.0f;   // meters
  float truncation = 0.0f;   // meters
  GravityAlignment upright;  // gravity direction, and rotation from the voxel frame to the world
  Axes axes = Axes::world;   // axes of the file; the grid transforms rotate to them
  SurfaceSigma sigma;        // in the voxel frame; empty: unknown
};

/// Writes the grids of a map.vdb: `tsdf` (float, meters, level set), `weight` (float), `color` (vec3f, 0..1, sRGB) and
/// `color_weight` (float, frames), active where the weight is not 0; `observed` and `free` (bool), active at the
/// lowest corner of each cell of fully_observed_cells and at free voxels. Inactive voxels of `tsdf` have the signs of
/// fill_unknown_signs, inactive tiles those of inside_neighbors. If known, `sigma` (float, meters) has one voxel per
/// cell of SurfaceSigma. Atomic. The map is added in parts, which are stored packed on disk until write(). Throws
/// std::runtime_error.
class GridsWriter {
 public:
  GridsWriter(std::filesystem::path file, const GridInfo& info);
  ~GridsWriter();
  /// Adds bricks. They must follow the bricks of earlier calls in the order of before_in_grid.
  void add(const BrickTree& bricks);
  /// Writes the file, with the free space of `free`. With `distances`, also writes the grid `esdf`; see write_distances
  /// in cairn/mapping/esdf.hpp.
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
