// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "cairn/mapping/map.hpp"
#include "export/map_chunks.hpp"
#include "export/views.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {

struct MapState;

/// Block of a map, made separately, see Cells.
struct MapBlock {
  Eigen::Vector3i block = Eigen::Vector3i::Zero();
  std::vector<std::size_t> submaps, keyframes;  // submaps in the block and keyframes with a view of it, sorted
};

/// Source of a Map: a mapper's state, or the grids of a file.
class MapContents {
 public:
  virtual ~MapContents() = default;
  [[nodiscard]] virtual Mesh mesh() = 0;
  [[nodiscard]] virtual Voxels voxels() = 0;
  /// `options` null: the mapper's own.
  [[nodiscard]] virtual std::shared_ptr<const DistanceField> distances(const EsdfOptions* options,
                                                                       const Trajectory& visited) = 0;
  virtual ExportReport export_mesh(const std::filesystem::path& file, const ExportOptions& options,
                                   const ExportProgress& progress) = 0;
  virtual ExportViewsReport export_views(const std::filesystem::path& folder, const ViewsOptions& options,
                                         const ExportProgress& progress) = 0;
  virtual ExportedPlan export_plan(const std::filesystem::path& file, const PlanOptions& options,
                                   const ExportProgress& progress) = 0;
  virtual void write_grids(const std::filesystem::path& file, Axes axes) = 0;
  /// Keyframes with color. Throws std::runtime_error for a map without keyframes.
  [[nodiscard]] virtual ViewsInput views() = 0;
  /// Device of the map.
  [[nodiscard]] virtual gpu::Device& device() = 0;
  virtual void write_graph(const std::filesystem::path& file) const = 0;
  /// Calls `visit` with all voxels, valid during the call.
  virtual void look(const std::function<void(const MapChunks&)>& visit) = 0;
  [[nodiscard]] virtual GravityAlignment upright() const = 0;
  virtual void set_up_axis(Up up) = 0;
  [[nodiscard]] virtual int recordings() const = 0;
  [[nodiscard]] virtual Trajectory trajectory(int recording) const = 0;
  [[nodiscard]] virtual Statistics statistics() const = 0;
};

/// Contents of a Map, for the library itself.
class MapAccess {
 public:
  [[nodiscard]] static Map map_of(std::shared_ptr<MapContents> contents) { return Map(std::move(contents)); }
  [[nodiscard]] static MapContents& contents(const Map& map) { return *map.contents_; }
};

[[nodiscard]] Map map_of(std::shared_ptr<MapState> state);
/// Calls `visit` with the contents of the given submaps (sorted numbers) of the main component; null: the entire map.
void look_at(MapState& state, const std::vector<std::size_t>* submaps,
             const std::function<void(const MapChunks&)>& visit);
/// Surface of a block from the given submaps only, in the written world.
[[nodiscard]] Mesh surface_of_block(MapState& state, const Eigen::Vector3i& block,
                                    const std::vector<std::size_t>& submaps);
/// Writes FOLDER/map.vdb with the block's voxels, and FOLDER/tileset.json with its surface.
ExportReport export_block(MapState& state, const MapBlock& block, const std::filesystem::path& folder,
                          const ExportOptions& options, const ExportProgress& progress);
/// Opens a .vdb file written by write_grids. Throws std::runtime_error for any other file.
[[nodiscard]] Map map_of_grids(const std::filesystem::path& vdb, int device);
/// Map of the voxels in a box, read from such files, `vdb` among them.
[[nodiscard]] Map map_of_box(const std::filesystem::path& vdb, ReadGrids grids, const BrickBox& box, int device);

}  // namespace cairn
