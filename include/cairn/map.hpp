// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/export.hpp"
#include "cairn/floor_plan.hpp"
#include "cairn/mesh.hpp"
#include "cairn/reports.hpp"
#include "cairn/trajectory.hpp"
#include "cairn/upright.hpp"
#include "cairn/voxels.hpp"

namespace cairn {

/// What comes out: the surface, the grids, distances, files.
///
///   cairn::Map map = cairn::Map::open("out/desk");
///   map.export_mesh("desk.glb", {.texture = {.enabled = true}});
///
/// A mapper's map (Mapper::map) is always as of its last frame, and is used by the mapper's thread.
class Map {
 public:
  /// The map in a folder that `cairn reconstruct`, `live` or `merge` has made: the one of its session, as that was last
  /// written; where there is none, and for a .vdb file, the grids alone, which have neither keyframes nor a trajectory.
  /// Nothing in the folder changes, and a mapper that writes there is not disturbed. `device`: as list_devices numbers
  /// them; -1 chooses. Throws std::runtime_error with what is missing or damaged and what to do.
  [[nodiscard]] static Map open(const std::filesystem::path& folder, int device = -1);

  /// The surface as it is in the volume (marching cubes: Lorensen & Cline 1987), world frame, metres, with normals and
  /// colours; of an adjusted map also with how surely it is known.
  [[nodiscard]] Mesh mesh();
  /// All voxels that were observed, as numbers.
  [[nodiscard]] Voxels voxels();
  /// The distance field of the whole map, made anew from its surface. Around each pose of `visited` what is nearer than
  /// EsdfOptions::robot_radius is free, beside what the map knows to be. Throws std::runtime_error when the voxel size
  /// is not 1, 2, 4 or 8 voxels of the TSDF.
  [[nodiscard]] std::shared_ptr<const DistanceField> distances(const EsdfOptions& options,
                                                               const Trajectory& visited = {});
  [[nodiscard]] std::shared_ptr<const DistanceField> distances();  ///< with the mapper's own options
  /// Writes the surface: clean, simplified, textured and packed as asked for; by the extension .glb, .gltf, .ply, .obj,
  /// .stl, or a tileset.json (3D Tiles 1.1) with its tiles in a folder beside it. It works cell by cell. Each file
  /// whole or not at all, the one that was asked for last. Throws std::runtime_error with what is wrong and what to do.
  Exported export_mesh(const std::filesystem::path& file, const ExportOptions& options = {},
                       const ExportProgress& progress = {});
  /// Writes images with poses and depth, and points of the surface, into a new folder: keyframes as the colour camera
  /// saw them, in its full size, without its lens. Whole or not at all. Throws std::runtime_error for a map without
  /// keyframes or colour, and for a folder that holds something.
  ExportedViews export_views(const std::filesystem::path& folder, const ViewsOptions& options = {},
                             const ExportProgress& progress = {});
  /// Writes a floor plan to scale, by the extension: .pdf with a page for each storey, or .svg, of which several
  /// storeys get a file each: X-1.svg, X-2.svg, the lowest first. It works part by part. Each file whole or not at all.
  /// Throws std::runtime_error where it is not known which way is up, where no floor was seen, or nothing is cut.
  ExportedPlan export_plan(const std::filesystem::path& file, const PlanOptions& options = {},
                           const ExportProgress& progress = {});
  /// Writes the grids `tsdf`, `weight`, `colour`, `colour_weight`, `observed` and `free`, with EsdfOptions::live also
  /// `esdf`, and of an adjusted map `sigma`, to a .vdb file, whole or not at all. `axes`: of their transforms;
  /// automatic: the world's.
  void write_grids(const std::filesystem::path& file, Axes axes = Axes::automatic);
  /// Writes the keyframes' pose graph by the extension: .g2o, or .svg, a picture of it. Whole or not at all.
  void write_graph(const std::filesystem::path& file) const;

  /// Which way up it stands, see Mapper::upright; of a .vdb file as that says.
  [[nodiscard]] Upright upright() const;
  /// Turns all that is asked of the map or written from here on, as Options::up does. Throws std::runtime_error where
  /// a .vdb file alone does not tell what `up` asks for.
  void stand_up(Up up);
  /// Recordings that the map is made of, at least one.
  [[nodiscard]] int recordings() const;
  /// As Mapper::trajectory.
  [[nodiscard]] Trajectory trajectory(int recording = -1) const;
  [[nodiscard]] Statistics statistics() const;

  class Contents;
  explicit Map(std::shared_ptr<Contents> contents);                ///< for the library's own use
  [[nodiscard]] Contents& contents() const { return *contents_; }  ///< for the library's own use

 private:
  std::shared_ptr<Contents> contents_;
};

}  // namespace cairn
