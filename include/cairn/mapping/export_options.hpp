// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "cairn/mapping/mesh.hpp"

namespace cairn {

/// Mesh cleaning: removed components and filled holes.
struct CleanOptions {
  float min_component = 0.1f;  ///< meters; components with a shorter bounding box diagonal are removed
  float min_support =
      2.0f;  ///< observations at 1 m; components up to 3 * min_component with a lower mean weight are removed
  float min_weight = 0.0f;  ///< observations at 1 m; surface below it is removed, in addition to
                            ///< FuseOptions::min_mesh_weight
  float fill_holes = 0.0f;  ///< meters; holes with a shorter bounding box diagonal are closed; 0: none
};

struct SimplifyOptions {
  float ratio = 1.0f;         ///< fraction of triangles kept; more if max_error requires it
  float max_error = 0.0f;     ///< meters of surface deviation; 0: as needed for the ratio, at most two voxels
  std::size_t triangles = 0;  ///< replaces both: upper limit on triangles, regardless of deviation; 0: no limit
};

struct TextureOptions {
  bool enabled = false;
  float texel = 0.0f;   ///< meters; 0: resolution of the keyframes, coarser if it does not fit
  int max_size = 4096;  ///< texels per side of one texture
  bool png = false;     ///< PNG instead of JPEG
  int jpeg_quality = 90;
};

/// Vertex encoding in glTF.
enum class Compression {
  none,       ///< 32-bit numbers
  quantized,  ///< KHR_mesh_quantization: 16-bit positions and texture coordinates, 8-bit normals
  meshopt,    ///< KHR_mesh_quantization with EXT_meshopt_compression
  draco       ///< KHR_draco_mesh_compression
};

/// Second, smaller .glb of the same mesh for web pages, compressed with meshopt.
struct PreviewOptions {
  std::filesystem::path file;       ///< empty: none
  std::size_t triangles = 1 << 20;  ///< approximate; a map with less than about twice as many keeps all triangles
};

/// Geographic position (WGS 84), for 3D Tiles.
struct GeoPlace {
  double latitude = 0, longitude = 0;  ///< degrees north and east, of the map's origin
  double height = 0;                   ///< meters above the ellipsoid
  double heading = 0;                  ///< direction of the map's z axis, degrees clockwise from north
};

struct ExportOptions {
  CleanOptions clean;
  SimplifyOptions simplify;
  TextureOptions texture;
  Compression compression = Compression::none;
  float cell_size = 0.0f;       ///< meters; one node or tile per cell; 0: a single node unless the map is large
  float point_spacing = 0.0f;   ///< meters; writes points at this spacing instead of triangles (.ply); 0: triangles.
                                ///< Points that do not fit into memory are rejected before the work starts
  bool lit = false;             ///< glTF: shaded by the viewer's lights, for programs without unlit materials
  bool cameras = false;         ///< glTF: camera path as a line, and a camera per keyframe
  Axes axes = Axes::automatic;  ///< axes of the file
  std::optional<GeoPlace> geo;  ///< tileset.json: position on a globe
  int levels = 1;               ///< levels of detail, each with a quarter of the triangles: X.glb, X.lod1.glb, ...
  std::string source;           ///< `asset.extras`: recording of the map
  PreviewOptions preview;       ///< for single-file glTF
};

/// Programs that train a scene from posed images.
enum class ViewsFor {
  nerfstudio,  ///< transforms.json, images/, depths/, points.ply
  colmap       ///< sparse/0/cameras.txt, images.txt and points3D.txt, images/, depths/
};

struct ViewsOptions {
  ViewsFor program = ViewsFor::nerfstudio;
  int images = 0;               ///< upper limit, each the sharpest of a run of keyframes; 0: all keyframes
  float point_spacing = 0.02f;  ///< meters between surface points, the program's initial point cloud
};

}  // namespace cairn
