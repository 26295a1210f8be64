// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mesh.hpp"

namespace cairn {

/// What is taken away from the surface or added to it.
struct CleanOptions {
  float min_piece = 0.1f;    ///< metres; floating pieces whose bounding box has a shorter diagonal are removed,
  float min_support = 2.0f;  ///< and those of up to three times this size with fewer observations (at 1 m) on the mean
  float min_weight = 0.0f;   ///< observations at 1 m; surface that was seen less is removed.
                             ///< FuseOptions::min_mesh_weight has done so before
  float fill_holes = 0.0f;   ///< metres; holes whose bounding box has a shorter diagonal are closed; 0: none
};

struct SimplifyOptions {
  float ratio = 1.0f;         ///< of the triangles that is left, more where max_error does not allow it
  float max_error = 0.0f;     ///< metres that the surface may move; 0: as far as the ratio needs, two voxels at most
  std::size_t triangles = 0;  ///< in place of both: no more are left, however far the surface moves; 0: no such limit
};

struct TextureOptions {
  bool enabled = false;
  float texel = 0.0f;   ///< metres; 0: what the keyframes see, coarser where it would not fit
  int max_size = 4096;  ///< texels a side of one texture
  bool png = false;     ///< instead of JPEG
  int jpeg_quality = 90;
};

/// How glTF holds triangles.
enum class Compression {
  none,       ///< 32-bit numbers
  quantised,  ///< KHR_mesh_quantization: 16-bit positions and texture places, 8-bit normals
  meshopt,    ///< the same with EXT_meshopt_compression
  draco       ///< KHR_draco_mesh_compression
};

/// A second file of a mesh, for pages, made of the same parts: .glb, compressed with meshopt.
struct PreviewOptions {
  std::filesystem::path file;       ///< empty: none
  std::size_t triangles = 1 << 20;  ///< about; a map of less than about twice as many has no preview
};

/// A place on the Earth (WGS 84), for 3D Tiles.
struct GeoPlace {
  double latitude = 0, longitude = 0;  ///< degrees north and east, of the map's origin
  double height = 0;                   ///< metres above the ellipsoid
  double heading = 0;                  ///< degrees clockwise from north, where the map's z points
};

struct ExportOptions {
  CleanOptions clean;
  SimplifyOptions simplify;
  TextureOptions texture;
  Compression compression = Compression::none;
  float cell_size = 0.0f;  ///< metres; the map becomes a node or tile a cell; 0: one node as long as it is not large
  float point_spacing = 0.0f;  ///< metres; instead of triangles points that far apart (.ply); 0: triangles. What would
                               ///< not fit into the memory is refused before the work begins
  bool lit = false;      ///< glTF: colours are shaded by the viewer's lamps, for programs that do not know unlit ones
  bool cameras = false;  ///< glTF: the camera's path as a line, and a camera for each keyframe
  Axes axes = Axes::automatic;  ///< of the file
  std::optional<GeoPlace> geo;  ///< tileset.json: where globes show it
  int levels = 1;               ///< of detail, each with a quarter of the triangles: X.glb, X.lod1.glb, ...
  std::string source;           ///< for `asset.extras`: what the map was made from
  PreviewOptions preview;       ///< of glTF in one file
};

/// Throws std::runtime_error naming the option, its value and the allowed range, or what `file`'s kind cannot hold.
void check(const ExportOptions& options, const std::filesystem::path& file);

/// What was written.
struct Exported {
  std::size_t full_triangles = 0;  ///< of the map before anything was done to it
  std::size_t triangles = 0, vertices = 0, points = 0;
  std::size_t components_removed = 0, holes_filled = 0;
  float error = 0;  ///< metres by which simplification moved the surface at most, by its own account
  std::vector<std::filesystem::path> files;  ///< that were written, the one that was asked for first
  int parts = 0, textures = 0, charts = 0, tiles = 0;
  float texel = 0;  ///< metres; the coarsest
  std::size_t texels = 0;
  double textured_share = 0;  ///< of the texels that a keyframe sees; others have the voxels' colour
  int keyframes = 0;
  std::array<float, 7> colour_camera{0, 0, 0, 0,
                                     0, 0, 1};  ///< how it was found to differ from the depth camera: rotation
                                                ///< (rad), translation (metres), focal scale
  std::map<std::string, double> stage_ms;       ///< mesh, clean, simplify, charts, exposure, texture, write
};

/// Programs that learn a scene from images with poses.
enum class ViewsFor {
  nerfstudio,  ///< transforms.json, images/, depths/, points.ply
  colmap       ///< sparse/0/cameras.txt, images.txt and points3D.txt, images/, depths/
};

struct ViewsOptions {
  ViewsFor program = ViewsFor::nerfstudio;
  int images = 0;               ///< at most, each the sharpest of its stretch of the keyframes; 0: all keyframes
  float point_spacing = 0.02f;  ///< metres between the points of the surface, from which the program begins
};

/// Throws std::runtime_error naming the option, its value and the allowed range.
void check(const ViewsOptions& options);

struct ExportedViews {
  int images = 0, keyframes = 0;  ///< written, and of the map
  std::size_t points = 0;
};

/// Called after each step: about `done` of `count` equal parts of the time are over; `what` is done next. `done` never
/// falls, and is `count` in the end.
using ExportProgress = std::function<void(int done, int count, const std::string& what)>;

}  // namespace cairn
