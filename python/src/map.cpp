// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <string>
#include <tuple>

#include "base/file_name.hpp"
#include "base/no_texture.hpp"
#include "distances.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"
#include "trajectory.hpp"

namespace cairn::python {
namespace {

namespace fs = std::filesystem;

Compression compression_of(const std::optional<std::string>& name) {
  if (!name || *name == "none") return Compression::none;
  if (*name == "quantized") return Compression::quantized;
  if (*name == "meshopt") return Compression::meshopt;
  if (*name == "draco") return Compression::draco;
  throw py::value_error("compress is '" + *name + "'; quantized, meshopt or draco is expected");
}

Axes axes_of(const std::string& name) {
  for (const Axes axes : {Axes::world, Axes::y_up, Axes::z_up})
    if (name == to_string(axes)) return axes;
  throw py::value_error("axes is '" + name + "'; world, yup or zup is expected");
}

GeoPlace geo_place_of(const py::handle& value) {
  const auto [latitude, longitude, height, heading] = value.cast<std::tuple<double, double, double, double>>();
  return {.latitude = latitude, .longitude = longitude, .height = height, .heading = heading};
}

/// Default of `texture`: on if there is color.
ExportReport export_mesh(GuardedMap& map, const fs::path& file, ExportOptions options, std::optional<bool> texture,
                         const py::object& progress) {
  options.texture.enabled = texture.value_or(true);
  const ExportProgress callback = progress_to(progress);
  const std::string kind = extension_of(file);
  if (!texture && (kind == ".ply" || kind == ".stl")) options.texture.enabled = false;
  return map.guard->run([&] {
    try {
      return map.map.export_mesh(file, options, callback);
    } catch (const NoTexture&) {
      if (texture) throw;
    }
    options.texture.enabled = false;
    return map.map.export_mesh(file, options, callback);
  });
}

std::optional<ExportReport> export_file(GuardedMap& map, const fs::path& file, const py::kwargs& given) {
  ExportOptions o;
  std::optional<bool> texture;
  py::object progress = py::none();
  for (const auto& [key, value] : given) {
    const auto name = key.cast<std::string>();
    if (value.is_none()) continue;
    if (name == "texture")
      texture = value.cast<bool>();
    else if (name == "simplify")
      o.simplify.ratio = value.cast<float>();
    else if (name == "max_error")
      o.simplify.max_error = value.cast<float>();
    else if (name == "triangles")
      o.simplify.triangles = value.cast<std::size_t>();
    else if (name == "compress")
      o.compression = compression_of(value.cast<std::string>());
    else if (name == "texel")
      o.texture.texel = value.cast<float>();
    else if (name == "texture_size")
      o.texture.max_size = value.cast<int>();
    else if (name == "texture_png")
      o.texture.png = value.cast<bool>();
    else if (name == "jpeg_quality")
      o.texture.jpeg_quality = value.cast<int>();
    else if (name == "points")
      o.point_spacing = value.cast<float>();
    else if (name == "cell_size")
      o.cell_size = value.cast<float>();
    else if (name == "lods")
      o.levels = value.cast<int>();
    else if (name == "lit")
      o.lit = value.cast<bool>();
    else if (name == "cameras")
      o.cameras = value.cast<bool>();
    else if (name == "min_piece")
      o.clean.min_component = value.cast<float>();
    else if (name == "min_weight")
      o.clean.min_weight = value.cast<float>();
    else if (name == "fill_holes")
      o.clean.fill_holes = value.cast<float>();
    else if (name == "axes")
      o.axes = axes_of(value.cast<std::string>());
    else if (name == "geo")
      o.geo = geo_place_of(value);
    else if (name == "progress")
      progress = py::reinterpret_borrow<py::object>(value);
    else
      throw py::type_error("export has no option '" + name + "'");
  }
  if (const std::string kind = extension_of(file); kind == ".vdb")
    map.guard->run([&] { map.map.write_grids(file, o.axes); });
  else if (kind == ".g2o" || kind == ".svg")
    map.guard->run([&] { map.map.write_graph(file); });
  else
    return export_mesh(map, file, o, texture, progress);
  return std::nullopt;
}

ExportViewsReport export_views(GuardedMap& map, const fs::path& folder, const std::string& program, int images,
                               float points, const py::object& progress) {
  ViewsOptions options{.images = images, .point_spacing = points};
  if (program == "colmap")
    options.program = ViewsFor::colmap;
  else if (program != "nerfstudio")
    throw py::value_error("program is '" + program + "'; nerfstudio or colmap is expected");
  const ExportProgress callback = progress_to(progress);
  return map.guard->run([&] { return map.map.export_views(folder, options, callback); });
}

void add_export_reports(py::module_& m) {
  py::class_<ExportReport>(m, "ExportReport", "Result of Map.export.")
      .def_readonly("full_triangles", &ExportReport::full_triangles,
                    "Number of triangles before cleaning and simplification.")
      .def_readonly("triangles", &ExportReport::triangles)
      .def_readonly("vertices", &ExportReport::vertices)
      .def_readonly("points", &ExportReport::points)
      .def_readonly("components_removed", &ExportReport::components_removed)
      .def_readonly("holes_filled", &ExportReport::holes_filled)
      .def_readonly("error", &ExportReport::error, "Meters: maximum error of the simplification, as estimated by it.")
      .def_readonly("files", &ExportReport::files, "Written files; the requested one first.")
      .def_readonly("textures", &ExportReport::textures)
      .def_readonly("texel", &ExportReport::texel, "Median size of a texel, meters.")
      .def_readonly("textured_share", &ExportReport::textured_share, "Fraction of the texels seen by a keyframe.")
      .def_readonly("keyframes", &ExportReport::keyframes)
      .def_readonly("stage_ms", &ExportReport::stage_ms, "Milliseconds by stage.")
      .def("__repr__", [](const ExportReport& e) {
        return repr("ExportReport", {{"triangles", e.triangles}, {"textures", e.textures}, {"files", e.files}});
      });
  py::class_<ExportViewsReport>(m, "ExportViewsReport", "Result of Map.export_views.")
      .def_readonly("images", &ExportViewsReport::images)
      .def_readonly("keyframes", &ExportViewsReport::keyframes, "Number of keyframes of the map.")
      .def_readonly("points", &ExportViewsReport::points)
      .def("__repr__", [](const ExportViewsReport& e) {
        return repr("ExportViewsReport", {{"images", e.images}, {"keyframes", e.keyframes}, {"points", e.points}});
      });
}

}  // namespace

std::optional<EsdfOptions> distance_options(std::optional<float> voxel_size, std::optional<float> max_distance,
                                            std::optional<float> robot_radius, const EsdfOptions& otherwise) {
  if (!voxel_size && !max_distance && !robot_radius) return std::nullopt;
  EsdfOptions options = otherwise;
  if (voxel_size) options.voxel_size = *voxel_size;
  if (max_distance) options.max_distance = *max_distance;
  if (robot_radius) options.robot_radius = *robot_radius;
  return options;
}

void add_map(py::module_& m) {
  add_export_reports(m);
  py::class_<GuardedMap>(
      m, "Map",
      R"(Output of a mapper: surface, voxels, distances, files. A mapper's map is as of its last frame, and keeps the mapper
alive. All output is in the gravity-aligned world, meters, y down.)")
      .def_static(
          "open",
          [](const fs::path& folder, int device) {
            const py::gil_scoped_release release;
            return GuardedMap{Map::open(folder, device), std::make_shared<Guard>()};
          },
          py::arg("folder"), py::arg("device") = -1, R"(open(folder, device=-1)
--

Opens the map in a folder made by `cairn reconstruct`, `live` or `merge`, or of a .vdb file; read-only. device: index
of cairn.devices; -1 chooses. Raises Error with the missing or damaged file and the remedy.)")
      .def(
          "mesh", [](GuardedMap& s) { return s.guard->run([&] { return s.map.mesh(); }); }, R"(mesh(self)
--

Surface by marching cubes, with normals and colors, as a Mesh.)")
      .def(
          "voxels", [](GuardedMap& s) { return s.guard->run([&] { return s.map.voxels(); }); }, R"(voxels(self)
--

All observed voxels, as Voxels.)")
      .def(
          "distances",
          [](GuardedMap& s, const py::object& points, std::optional<float> voxel_size,
             std::optional<float> max_distance, std::optional<float> robot_radius, const py::object& visited) {
            return distances(*s.guard, points, distance_options(voxel_size, max_distance, robot_radius, {}), visited,
                             [&](const std::optional<EsdfOptions>& options, const Trajectory& poses) {
                               if (options || !poses.empty())
                                 return s.map.distances(options.value_or(EsdfOptions{}), poses);
                               return s.map.distances();
                             });
          },
          py::arg("points") = py::none(), py::kw_only(), py::arg("voxel_size") = std::nullopt,
          py::arg("max_distance") = std::nullopt, py::arg("robot_radius") = std::nullopt,
          py::arg("visited") = py::none(),
          R"(distances(self, points=None, *, voxel_size=None, max_distance=None, robot_radius=None, visited=None)
--

Distance field of the entire map, as a DistanceField; with points (..., 3) the result of DistanceField.query. Without
options the field is cached until the map changes.

voxel_size: meters; 1, 2, 4 or 8 voxels of the map. max_distance: meters. robot_radius: meters of free space around
each camera position. visited: Trajectory of the camera, for a map without one.)")
      .def(
          "export", &export_file, py::arg("file"),
          R"(export(self, file, *, texture=None, simplify=None, max_error=None, triangles=None, compress=None, texel=None, texture_size=None, texture_png=None, jpeg_quality=None, points=None, cell_size=None, lods=None, lit=None, cameras=None, min_piece=None, min_weight=None, fill_holes=None, axes=None, geo=None, progress=None)
--

Writes the map. The extension selects the format: .glb, .gltf, .ply, .obj, .stl or tileset.json for the surface, .vdb
for the voxels, .g2o and .svg for the pose graph. Each file is written atomically. Returns an ExportReport; None for
voxels and pose graph.

texture: True requires one, False omits it; default: a texture if the map has color. simplify: fraction of triangles
to keep. max_error: meters. triangles: maximum number. compress: 'quantized', 'meshopt' or 'draco'. texel: meters.
texture_size: texels per side. texture_png: PNG instead of JPEG. jpeg_quality: 1 to 100. points: writes points, with
this spacing in meters, instead of triangles (.ply). cell_size: meters. lods: number of levels of detail. lit: shaded
by the viewer's lights (glTF). cameras: adds path and keyframes (glTF). min_piece: meters, minimum size of a
component. min_weight: minimum weight of the surface, observations at 1 m. fill_holes: meters, maximum size of a
filled hole. axes: 'world' (x right, y down, z forward), 'yup' or 'zup'; default: convention of the format. geo:
latitude, longitude, height and heading of a tileset's origin (degrees; meters above the WGS 84 ellipsoid; heading of
the map's z axis, clockwise from north). progress: called with done, count and the next step.)")
      .def("export_views", &export_views, py::arg("folder"), py::kw_only(), py::arg("program") = "nerfstudio",
           py::arg("images") = 0, py::arg("point_spacing") = ViewsOptions{}.point_spacing,
           py::arg("progress") = py::none(),
           R"(export_views(self, folder, *, program='nerfstudio', images=0, point_spacing=0.02, progress=None)
--

Writes keyframes as images with poses and depth, and points of the surface, into a new folder, as input of NeRF and
Gaussian splatting ('nerfstudio', 'colmap'). images: maximum number, the sharpest of their neighbors; 0: all.
point_spacing: meters. Returns an ExportViewsReport.)")
      .def(
          "set_up_axis",
          [](GuardedMap& s, const std::string& up) { s.guard->change([&] { s.map.set_up_axis(parse_up(up)); }); },
          py::arg("up"), R"(set_up_axis(self, up)
--

Sets the up direction of all further output: 'auto', 'camera', or the up axis 'x', 'y', 'z', '-x', '-y' or '-z' of the
tracking frame, or of the given poses' world.)")
      .def(
          "upright", [](GuardedMap& s) { return s.guard->run([&] { return s.map.upright(); }); }, R"(upright(self)
--

Gravity alignment of the map, as GravityAlignment.)")
      .def_property_readonly(
          "recordings", [](GuardedMap& s) { return s.guard->run([&] { return s.map.recordings(); }); },
          "Number of recordings in the map, at least 1.")
      .def(
          "trajectory",
          [](GuardedMap& s, int recording) {
            return StampedPoses{s.guard->run([&] { return s.map.trajectory(recording); })};
          },
          py::arg("recording") = -1, R"(trajectory(self, recording=-1)
--

Poses of all fused frames in the gravity-aligned world, as a Trajectory. recording: counted from 0; -1: the last.)")
      .def(
          "statistics", [](GuardedMap& s) { return s.guard->run([&] { return s.map.statistics(); }); },
          R"(statistics(self)
--

Size and cost of the map, as Statistics.)");
}

}  // namespace cairn::python
