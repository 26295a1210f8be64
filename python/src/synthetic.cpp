// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/synthetic/synthetic.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "guard.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"
#include "trajectory.hpp"

namespace cairn::python {
namespace {

/// Images of a scene camera, with their size.
struct RenderedView {
  SceneImages images;
  Camera camera;
};

struct GuardedSceneCamera {
  GuardedSceneCamera(const Scene& scene, const Camera& c, int device) : camera(c), state(scene, c, device) {}
  Camera camera;
  SceneCamera state;
  Guard guard;
};

Doubles exact_distances(const Scene& scene, const py::object& points) {
  const auto at = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(points);
  if (!at || at.ndim() < 1 || at.shape(at.ndim() - 1) != 3) {
    PyErr_Clear();
    throw py::value_error("points is " + description_of(points) + "; (..., 3) is expected, in meters");
  }
  Doubles distances(leading_shape(at));
  double* to = distances.mutable_data();
  const double* from = at.data();
  const py::gil_scoped_release release;
  for (py::ssize_t i = 0; i < distances.size(); ++i) to[i] = scene.distance(Eigen::Vector3d(from + 3 * i));
  return distances;
}

py::array image(const py::object& self, const auto& pixels) {
  using T = std::remove_cvref_t<decltype(pixels[0])>;
  const auto& rendered = self.cast<const RenderedView&>();
  return view<T>(pixels.data(), {rendered.camera.height, rendered.camera.width}, self);
}

void add_scene(py::module_& m) {
  py::class_<Scene>(m, "Scene", R"(Scene(name)
--

Scene with an exactly known surface. World frame: meters, y down; the camera path starts near the origin.

name: 'room' (furnished), 'room-with-mover', 'flat' (four rooms), 'twin-rooms', 'sphere', 'plane', 'corridor',
'loop' or 'building?recording=17' (see docs/inputs.md).)")
      .def(py::init(&synthetic_scene), py::arg("name"), R"(__init__(self, name)
--

)")
      .def_readonly("name", &Scene::name)
      .def("distance", &exact_distances, py::arg("points"), R"(distance(self, points)
--

Exact distances at points (..., 3) to the nearest static surface, (...) float64, meters; negative inside.)")
      .def(
          "pose", [](const Scene& s, double seconds) { return to_numpy(s.world_from_camera(seconds)); },
          py::arg("time"), R"(pose(self, time)
--

Pose of a camera with handheld motion, world_from_camera, (4, 4). time: seconds.)")
      .def(
          "surface",
          [](const Scene& s, float spacing) {
            const py::gil_scoped_release release;
            return s.surface(spacing);
          },
          py::arg("spacing") = 0.02, R"(surface(self, spacing=0.02)
--

Static surface as a Mesh with edges of at most spacing meters, exact at its vertices.)")
      .def("__repr__", [](const Scene& s) {
        return repr("Scene", {{"name", s.name}});
      });
}

}  // namespace

void add_synthetic(py::module_& m) {
  add_scene(m);
  py::class_<RenderedView>(m, "SceneImages", "Rendered images of a scene. Arrays are views of its memory.")
      .def_property_readonly(
          "depth", [](const py::object& self) { return image(self, self.cast<const RenderedView&>().images.depth); },
          "(rows, columns) float32, meters along z; 0: no surface within 100 m.")
      .def_property_readonly(
          "color",
          [](const py::object& self) {
            const auto& l = self.cast<const RenderedView&>();
            const py::ssize_t rows = l.camera.height, columns = l.camera.width;
            return py::array_t<std::uint8_t>({rows, columns, py::ssize_t{3}},
                                             {4 * columns, py::ssize_t{4}, py::ssize_t{1}},
                                             reinterpret_cast<const std::uint8_t*>(l.images.color.data()), self);
          },
          "(rows, columns, 3) uint8, R, G, B.")
      .def_property_readonly(
          "confidence",
          [](const py::object& self) -> py::object {
            const auto& l = self.cast<const RenderedView&>();
            return l.images.confidence.empty() ? py::object(py::none()) : image(self, l.images.confidence);
          },
          "(rows, columns) uint8 with the noise of a phone's lidar, or None.")
      .def(
          "add_noise",
          [](RenderedView& l, const std::string& kind, std::uint64_t seed, int frame) {
            const py::gil_scoped_release release;
            SceneImages noisy = l.images;
            add_noise(noisy, l.camera, kind, seed, frame);
            return RenderedView{std::move(noisy), l.camera};
          },
          py::arg("kind") = "kinect", py::kw_only(), py::arg("seed") = 1, py::arg("frame") = 0,
          R"(add_noise(self, kind='kinect', *, seed=1, frame=0)
--

Images with the noise of a depth camera, as new SceneImages. kind: 'kinect', 'tof', 'stereo', 'lidar' (with
confidence) or 'none'. Deterministic for the same seed and frame.)");
  py::class_<GuardedSceneCamera>(m, "SceneCamera", R"(SceneCamera(scene, camera=None, *, device=-1)
--

Camera in a Scene, rendered on its own device. Default of camera: the camera of synthetic recordings.)")
      .def(py::init([](const Scene& scene, const std::optional<Camera>& camera, int device) {
             const py::gil_scoped_release release;
             return std::make_unique<GuardedSceneCamera>(scene, camera.value_or(synthetic_camera()), device);
           }),
           py::arg("scene"), py::arg("camera") = std::nullopt, py::kw_only(), py::arg("device") = -1,
           R"(__init__(self, scene, camera=None, *, device=-1)
--

)")
      .def_readonly("camera", &GuardedSceneCamera::camera)
      .def(
          "look",
          [](GuardedSceneCamera& c, const py::object& pose, double time) {
            const Eigen::Isometry3d at = pose_of(pose, "pose");
            return RenderedView{c.guard.run([&] { return c.state.render(at, time); }), c.camera};
          },
          py::arg("pose"), py::arg("time") = 0.0, R"(look(self, pose, time=0.0)
--

Renders exact images, as SceneImages. pose: world_from_camera (4, 4). time: seconds.)");
}

}  // namespace cairn::python
