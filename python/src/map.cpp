// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <string>
#include <tuple>

#include "cairn/file_name.hpp"
#include "cairn/no_texture.hpp"
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
  if (*name == "quantised") return Compression::quantised;
  if (*name == "meshopt") return Compression::meshopt;
  if (*name == "draco") return Compression::draco;
  throw py::value_error("compress is '" + *name + "'; quantised, meshopt or draco is expected");
}

Axes axes_of(const std::string& name) {
  for (const Axes axes : {Axes::world, Axes::y_up, Axes::z_up})
    if (name == name_of(axes)) return axes;
  throw py::value_error("axes is '" + name + "'; world, yup or zup is expected");
}

GeoPlace place_of(const py::handle& value) {
  const auto [latitude, longitude, height, heading] = value.cast<std::tuple<double, double, double, double>>();
  return {.latitude = latitude, .longitude = longitude, .height = height, .heading = heading};
}

/// Default of `texture`: on if there is color.
Exported export_mesh(GuardedMap& map, const fs::path& file, ExportOptions options, std::optional<bool> texture,
                     const py::object& progress) {
  options.texture.enabled = texture.value_or(true);
  const ExportProgress told = progress_to(progress);
  const std::string kind = extension_of(file);
  if (!texture && (kind == ".ply" || kind == ".stl")) options.texture.enabled = false;
  return map.guard->run([&] {
    try {
      return map.map.export_mesh(file, options, told);
    } catch (const NoTexture&) {
      if (texture) throw;
    }
    options.texture.enabled = false;
    return map.map.export_mesh(file, options, told);
  });
}

std::optional<Exported> export_file(GuardedMap& map, const fs::path& file, const py::kwargs& given) {
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
      o.clean.min_piece = value.cast<float>();
    else if (name == "min_weight")
      o.clean.min_weight = value.cast<float>();
    else if (name == "fill_holes")
      o.clean.fill_holes = value.cast<float>();
    else if (name == "axes")
      o.axes = axes_of(value.cast<std::string>());
    else if (name == "geo")
      o.geo = place_of(value);
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

ExportedViews export_views(GuardedMap& map, const fs::path& folder, const std::string& program, int images,
                           float points, const py::object& progress) {
  ViewsOptions options{.images = images, .point_spacing = points};
  if (program == "colmap")
    options.program = ViewsFor::colmap;
  else if (program != "nerfstudio")
    throw py::value_error("program is '" + program + "'; nerfstudio or colmap is expected");
  const ExportProgress told = progress_to(progress);
  return map.guard->run([&] { return map.map.export_views(folder, options, told); });
}

void add_exported(py::module_& m) {
  py::class_<Exported>(m, "Exported", "What Map.export wrote.")
      .def_readonly("full_triangles", &Exported::full_triangles, "Of the map before anything was done to it.")
      .def_readonly("triangles", &Exported::triangles)
      .def_readonly("vertices", &Exported::vertices)
      .def_readonly("points", &Exported::points)
      .def_readonly("components_removed", &Exported::components_removed)
      .def_readonly("holes_filled", &Exported::holes_filled)
      .def_readonly("error", &Exported::error,
                    "Metres by which simplification moved the surface at most, by its own account.")
      .def_readonly("files", &Exported::files, "That were written, the one that was asked for first.")
      .def_readonly("textures", &Exported::textures)
      .def_readonly("texel", &Exported::texel, "Metres; the coarsest.")
      .def_readonly("textured_share", &Exported::textured_share, "Of the texels that a keyframe sees.")
      .def_readonly("keyframes", &Exported::keyframes)
      .def_readonly("stage_ms", &Exported::stage_ms, "Milliseconds by stage.")
      .def("__repr__", [](const Exported& e) {
        return repr("Exported", {{"triangles", e.triangles}, {"textures", e.textures}, {"files", e.files}});
      });
  py::class_<ExportedViews>(m, "ExportedViews", "What Map.export_views wrote.")
      .def_readonly("images", &ExportedViews::images)
      .def_readonly("keyframes", &ExportedViews::keyframes, "Of the map.")
      .def_readonly("points", &ExportedViews::points)
      .def("__repr__", [](const ExportedViews& e) {
        return repr("ExportedViews", {{"images", e.images}, {"keyframes", e.keyframes}, {"points", e.points}});
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
  add_exported(m);
  py::class_<GuardedMap>(
      m, "Map",
      R"(What comes out: the surface, the voxels, distances, files. A mapper's map is always as of its last frame, and keeps the
mapper alive. All of it is in the upright world, metres, y down.)")
      .def_static(
          "open",
          [](const fs::path& folder, int device) {
            const py::gil_scoped_release release;
            return GuardedMap{Map::open(folder, device), std::make_shared<Guard>()};
          },
          py::arg("folder"), py::arg("device") = -1, R"(open(folder, device=-1)
--

The map in a folder that cairn.reconstruct, live or merge has made, or of a .vdb file. Nothing in the folder changes.
device: as cairn.devices numbers them; -1 chooses. Raises Error with what is missing or damaged and what to do.)")
      .def(
          "mesh", [](GuardedMap& s) { return s.guard->run([&] { return s.map.mesh(); }); }, R"(mesh(self)
--

The surface as it is in the voxels (marching cubes), with normals and colors, as a Mesh.)")
      .def(
          "voxels", [](GuardedMap& s) { return s.guard->run([&] { return s.map.voxels(); }); }, R"(voxels(self)
--

All voxels that were observed, as Voxels.)")
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

The distance field of the whole map, a DistanceField; with points (..., 3) its answers there, as DistanceField.query.
Without options it is made once, and again after the map has changed.

voxel_size: metres, 1, 2, 4 or 8 voxels of the map. max_distance: metres. robot_radius: metres around the camera that are
free wherever it was. visited: a Trajectory, where it was, of a map that does not know.)")
      .def(
          "export", &export_file, py::arg("file"),
          R"(export(self, file, *, texture=None, simplify=None, max_error=None, triangles=None, compress=None, texel=None, texture_size=None, texture_png=None, jpeg_quality=None, points=None, cell_size=None, lods=None, lit=None, cameras=None, min_piece=None, min_weight=None, fill_holes=None, axes=None, geo=None, progress=None)
--

Writes the surface, by the extension: .glb, .gltf, .ply, .obj, .stl or a tileset.json; .vdb writes the voxels, .g2o and
.svg the pose graph (and return None). Each file whole or not at all. Returns what was written, as Exported.

texture: True asks for one, False leaves it out; by default there is one wherever there is color. simplify: share of the
triangles that is left. max_error: metres. triangles: no more than so many. compress: 'quantised', 'meshopt', 'draco'.
texel: metres. texture_size: texels a side. texture_png: instead of JPEG. jpeg_quality: 1 to 100. points: metres between
points, instead of triangles (.ply). cell_size: metres. lods: levels of detail. lit: glTF shaded by the viewer's
lamps. cameras: the path and keyframes, in glTF.
min_piece, min_weight, fill_holes: what cleaning removes and closes. axes: 'world' (x right, y down, z forward), 'yup' or
'zup'; by default as programs expect them of the format. geo: latitude, longitude, height and heading of a tileset's
origin (degrees; metres above WGS 84's ellipsoid; clockwise from north, where the map's z points). progress: called with done, count and what is next.)")
      .def("export_views", &export_views, py::arg("folder"), py::kw_only(), py::arg("program") = "nerfstudio",
           py::arg("images") = 0, py::arg("point_spacing") = ViewsOptions{}.point_spacing,
           py::arg("progress") = py::none(),
           R"(export_views(self, folder, *, program='nerfstudio', images=0, point_spacing=0.02, progress=None)
--

Writes keyframes as images with poses and depth, and points of the surface, into a new folder, for programs that learn a
scene ('nerfstudio', 'colmap'). images: at most, each the sharpest of its surroundings; 0: all. point_spacing: metres.
Returns ExportedViews.)")
      .def(
          "stand_up", [](GuardedMap& s, const std::string& up) { s.guard->change([&] { s.map.stand_up(up_of(up)); }); },
          py::arg("up"), R"(stand_up(self, up)
--

Turns all that is asked of the map or written from here on: 'auto', 'camera', or the axis that points up, 'x', 'y', 'z',
'-x', '-y' or '-z', of the given poses' world or of the first camera.)")
      .def(
          "upright", [](GuardedMap& s) { return s.guard->run([&] { return s.map.upright(); }); }, R"(upright(self)
--

Which way up the map stands, as Upright.)")
      .def_property_readonly(
          "recordings", [](GuardedMap& s) { return s.guard->run([&] { return s.map.recordings(); }); },
          "That the map is made of, at least one.")
      .def(
          "trajectory",
          [](GuardedMap& s, int recording) {
            return StampedPoses{s.guard->run([&] { return s.map.trajectory(recording); })};
          },
          py::arg("recording") = -1, R"(trajectory(self, recording=-1)
--

Of all fused frames as a Trajectory in the world; recording counts from 0, -1 is the last.)")
      .def(
          "statistics", [](GuardedMap& s) { return s.guard->run([&] { return s.map.statistics(); }); },
          R"(statistics(self)
--

How large the map is and what it cost, as Statistics.)");
}

}  // namespace cairn::python
