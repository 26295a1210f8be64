// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/export.hpp"
#include "cairn/mapping/floor_plan.hpp"
#include "cairn/mapping/gravity_alignment.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "cairn/mapping/voxels.hpp"

namespace cairn {

class MapAccess;
class MapContents;

/// The map: access to surface, grids, distance field and file export.
///
///   cairn::Map map = cairn::Map::open("out/desk");
///   map.export_mesh("desk.glb", {.texture = {.enabled = true}});
///
/// A Map from Mapper::map is a view of the mapper's current state; use it from the mapper's thread.
class Map {
 public:
  /// Opens the map in a folder made by `cairn reconstruct`, `live` or `merge`: its session, as of the last checkpoint.
  /// Without a session, and for a .vdb file, it has the grids only, without keyframes or trajectory. Does not modify
  /// the folder or disturb a mapper writing there. `device`: index of list_devices; -1 chooses. Throws
  /// std::runtime_error with the missing or damaged file and the remedy.
  [[nodiscard]] static Map open(const std::filesystem::path& folder, int device = -1);

  /// Surface of the volume (marching cubes: Lorensen & Cline 1987), world frame, meters, with normals and colors; for
  /// an adjusted map also with the standard deviation of each vertex.
  [[nodiscard]] Mesh mesh();
  /// All observed voxels, as plain arrays.
  [[nodiscard]] Voxels voxels();
  /// Distance field of the entire map, recomputed from its surface. Around each pose of `visited`, points within
  /// EsdfOptions::robot_radius are free, in addition to the map's free space. Throws std::runtime_error if the voxel
  /// size is not 1, 2, 4 or 8 voxels of the TSDF.
  [[nodiscard]] std::shared_ptr<const DistanceField> distances(const EsdfOptions& options,
                                                               const Trajectory& visited = {});
  [[nodiscard]] std::shared_ptr<const DistanceField> distances();  ///< uses the mapper's options
  /// Writes the surface: cleaned, simplified, textured and compressed as requested. The extension selects the format:
  /// .glb, .gltf, .ply, .obj, .stl, or a tileset.json (3D Tiles 1.1) with its tiles in a folder beside it. Works cell
  /// by cell. Writes each file atomically, the requested file last. Throws std::runtime_error with the cause and the
  /// remedy.
  ExportReport export_mesh(const std::filesystem::path& file, const ExportOptions& options = {},
                           const ExportProgress& progress = {});
  /// Writes posed images with depth, and points of the surface, into a new folder: keyframes in the view and full size
  /// of the color camera, undistorted. Atomic. Throws std::runtime_error for a map without keyframes or color, and for
  /// a folder that is not empty.
  ExportViewsReport export_views(const std::filesystem::path& folder, const ViewsOptions& options = {},
                                 const ExportProgress& progress = {});
  /// Writes a floor plan to scale. The extension selects the format: .pdf with a page per storey, .svg, or .dxf in
  /// meters; .svg and .dxf with one file per storey if there are several: X-1.svg, X-2.svg, lowest first. Works part by
  /// part. Writes each file atomically. Throws std::runtime_error if the gravity direction is unknown, no floor was
  /// observed, or the cut is empty.
  ExportedPlan export_plan(const std::filesystem::path& file, const PlanOptions& options = {},
                           const ExportProgress& progress = {});
  /// Writes the grids `tsdf`, `weight`, `color`, `color_weight`, `observed` and `free`, with EsdfOptions::live also
  /// `esdf`, and for an adjusted map `sigma`, to a .vdb file atomically. `axes`: target axes of the grids' transforms;
  /// automatic: the world's.
  void write_grids(const std::filesystem::path& file, Axes axes = Axes::automatic);
  /// Writes the pose graph of the keyframes as .g2o, or a drawing of it as .svg. Atomic.
  void write_graph(const std::filesystem::path& file) const;

  /// Gravity alignment, see Mapper::upright; for a .vdb file as stored in it.
  [[nodiscard]] GravityAlignment upright() const;
  /// Rotates all later output of this map, as Options::up does. Throws std::runtime_error if `up` needs data absent
  /// from a .vdb file.
  void set_up_axis(Up up);
  /// Number of recordings in the map, at least one.
  [[nodiscard]] int recordings() const;
  /// Same as Mapper::trajectory.
  [[nodiscard]] Trajectory trajectory(int recording = -1) const;
  [[nodiscard]] Statistics statistics() const;

 private:
  friend class MapAccess;
  explicit Map(std::shared_ptr<MapContents> contents);

  std::shared_ptr<MapContents> contents_;
};

}  // namespace cairn
