// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/mesh.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

py::ssize_t count(const auto& list) { return static_cast<py::ssize_t>(list.size()); }

/// View (N, columns) of a list of the mesh; None if the list is empty but the mesh is not.
template <class T, class List>
py::object column(const py::object& self, const List& list, py::ssize_t columns, bool is_optional) {
  if (is_optional && list.empty()) return py::none();
  return view(reinterpret_cast<const T*>(list.data()), {count(list), columns}, self);
}

std::vector<Eigen::Vector3f> vectors_of(const py::handle& value, const char* name) {
  const Floats points = points_of(value, name);
  if (points.ndim() != 2)
    throw py::value_error(std::string(name) + " is " + description_of(points) + "; (N, 3) is expected");
  const auto list = vectors(points);
  return {list.begin(), list.end()};
}

std::vector<std::array<std::uint8_t, 4>> colors_of(const py::handle& value) {
  const py::array array = py::array::ensure(value);
  if (!array || !array.dtype().is(py::dtype::of<std::uint8_t>()) || array.ndim() != 2 ||
      (array.shape(1) != 3 && array.shape(1) != 4)) {
    PyErr_Clear();
    throw py::value_error("colors is " + description_of(value) + "; uint8 of shape (N, 3) or (N, 4) is expected");
  }
  const auto bytes = py::array_t<std::uint8_t, py::array::c_style>::ensure(array);
  std::vector<std::array<std::uint8_t, 4>> colors;
  for (py::ssize_t i = 0; i < bytes.shape(0); ++i)
    colors.push_back({bytes.at(i, 0), bytes.at(i, 1), bytes.at(i, 2), 255});
  return colors;
}

Mesh make_mesh(const py::object& vertices, const py::object& triangles, const py::object& colors,
               const py::object& normals) {
  Mesh mesh;
  mesh.positions = vectors_of(vertices, "vertices");
  mesh.triangles = triangles_of(triangles, mesh.positions.size());
  if (!colors.is_none()) mesh.colors = colors_of(colors);
  if (!normals.is_none()) mesh.normals = vectors_of(normals, "normals");
  for (const auto& [name, size] : {std::pair("colors", mesh.colors.size()), std::pair("normals", mesh.normals.size())})
    if (size != 0 && size != mesh.positions.size())
      throw py::value_error(std::string(name) + " has " + std::to_string(size) + " rows; " +
                            std::to_string(mesh.positions.size()) + " are expected, one per vertex");
  return mesh;
}

Mesh transformed(const Mesh& mesh, const py::object& pose) {
  const Eigen::Isometry3f transform = pose_of(pose, "pose").cast<float>();
  Mesh result = mesh;
  for (auto& p : result.positions) p = transform * p;
  for (auto& n : result.normals) n = transform.linear() * n;
  return result;
}

}  // namespace

void add_mesh(py::module_& m) {
  py::class_<Mesh>(m, "Mesh", R"(Mesh(vertices, triangles, *, colors=None, normals=None)
--

Triangle mesh in the map's world frame, meters; triangles are counter-clockwise seen from outside. Arrays are writable
views of the mesh's memory and keep the mesh alive.

vertices: (N, 3). triangles: (M, 3), integers. colors: (N, 3 or 4) uint8, sRGB. normals: (N, 3).)")
      .def(py::init(&make_mesh), py::arg("vertices"), py::arg("triangles"), py::kw_only(),
           py::arg("colors") = py::none(), py::arg("normals") = py::none(),
           R"(__init__(self, vertices, triangles, *, colors=None, normals=None)
--

)")
      .def_property_readonly(
          "vertices",
          [](const py::object& self) { return column<float>(self, self.cast<const Mesh&>().positions, 3, false); },
          "(N, 3) float32, meters.")
      .def_property_readonly(
          "normals",
          [](const py::object& self) { return column<float>(self, self.cast<const Mesh&>().normals, 3, true); },
          "(N, 3) float32, unit length, away from the solid; or None.")
      .def_property_readonly(
          "colors",
          [](const py::object& self) { return column<std::uint8_t>(self, self.cast<const Mesh&>().colors, 4, true); },
          "(N, 4) uint8, R, G, B, 255 (sRGB), or None.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) {
            const auto triangles = column<std::uint32_t>(self, self.cast<const Mesh&>().triangles, 3, false);
            make_read_only(triangles);  // all indices must stay valid
            return triangles;
          },
          "(M, 3) uint32; read-only.")
      .def_property_readonly(
          "weights",
          [](const py::object& self) -> py::object {
            const auto& mesh = self.cast<const Mesh&>();
            if (mesh.weights.empty()) return py::none();
            return view(mesh.weights.data(), {count(mesh.weights)}, self);
          },
          "(N,) float32, observations at 1 m, for the mesh of a map; or None.")
      .def_property_readonly(
          "sigmas",
          [](const py::object& self) -> py::object {
            const auto& mesh = self.cast<const Mesh&>();
            if (mesh.sigmas.empty()) return py::none();
            return view(mesh.sigmas.data(), {count(mesh.sigmas)}, self);
          },
          "(N,) float32, meters: standard deviation of the surface along its normal, for an adjusted map; or None.")
      .def_property_readonly(
          "texture_coordinates",
          [](const py::object& self) {
            return column<float>(self, self.cast<const Mesh&>().texture_coordinates, 2, true);
          },
          "(N, 2) float32; (0, 0) is the upper left corner of the texture; or None.")
      .def_property_readonly(
          "texture",
          [](const py::object& self) -> py::object {
            const Texture& t = self.cast<const Mesh&>().texture;
            if (t.texels.empty()) return py::none();
            return view(reinterpret_cast<const std::uint8_t*>(t.texels.data()), {t.height, t.width, 3}, self);
          },
          "(rows, columns, 3) uint8, sRGB, or None.")
      .def("transformed", &transformed, py::arg("pose"), R"(transformed(self, pose)
--

Copy of the mesh, transformed by a pose, (4, 4).)")
      .def_static(
          "read",
          [](const std::filesystem::path& file) {
            const py::gil_scoped_release release;
            return read_mesh(file);
          },
          py::arg("file"), R"(read(file)
--

Reads .glb, .gltf or .ply, converted to the world frame. Merges several parts into one mesh without texture.)")
      .def_static(
          "read_parts",
          [](const std::filesystem::path& file) {
            const py::gil_scoped_release release;
            return read_mesh_parts(file);
          },
          py::arg("file"), R"(read_parts(file)
--

Reads .glb, .gltf or .ply as a list of Mesh, each with its own texture.)")
      .def(
          "write",
          [](const Mesh& mesh, const std::filesystem::path& file) {
            const py::gil_scoped_release release;
            write_mesh(file, mesh);
          },
          py::arg("file"), R"(write(self, file)
--

Writes .glb, .gltf, .ply, .obj or .stl, atomically. glTF and OBJ are y up, STL z up, PLY in the world frame.)")
      .def("__repr__", [](const Mesh& mesh) {
        return "Mesh of " + std::to_string(mesh.positions.size()) + " vertices, " +
               std::to_string(mesh.triangles.size()) + " triangles";
      });
}

}  // namespace cairn::python
