// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <pybind11/operators.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>

#include "cairn/io/known_cameras.hpp"
#include "cairn/mapping/rig.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

Lens lens_of(const std::string& name) {
  if (name == "brown_conrady") return Lens::brown_conrady;
  if (name == "fisheye") return Lens::fisheye;
  throw py::value_error("lens is '" + name + "'; brown_conrady or fisheye is expected");
}

std::string to_string(Lens lens) { return lens == Lens::fisheye ? "fisheye" : "brown_conrady"; }

Camera resized(const Camera& camera, int width, int height) {
  if (static_cast<std::int64_t>(width) * camera.height != static_cast<std::int64_t>(height) * camera.width)
    throw py::value_error("images of " + std::to_string(width) + "x" + std::to_string(height) +
                          " have another aspect ratio than the camera's " + std::to_string(camera.width) + "x" +
                          std::to_string(camera.height));
  const double scale = static_cast<double>(width) / camera.width;
  Camera c = camera;
  c.width = width, c.height = height;
  c.fx *= scale, c.fy *= scale;
  c.cx = (camera.cx + 0.5) * scale - 0.5, c.cy = (camera.cy + 0.5) * scale - 0.5;
  return c;
}

Camera make_camera(int width, int height, double fx, double fy, std::optional<double> cx, std::optional<double> cy,
                   const std::vector<double>& distortion, const std::string& lens, double readout) {
  Camera camera{.width = width,
                .height = height,
                .fx = fx,
                .fy = fy,
                .cx = cx.value_or(0.5 * (width - 1)),
                .cy = cy.value_or(0.5 * (height - 1)),
                .distortion = {},
                .lens = lens_of(lens),
                .readout = readout};
  if (distortion.size() > camera.distortion.size())
    throw py::value_error("distortion has " + std::to_string(distortion.size()) + " numbers; at most 8 are expected");
  std::copy(distortion.begin(), distortion.end(), camera.distortion.begin());
  check(camera);
  return camera;
}

Camera known(const std::string& name) {
  if (const KnownCamera* camera = known_camera(name)) return camera->camera;
  std::string names;
  for (const KnownCamera& camera : known_cameras()) names += (names.empty() ? "" : ", ") + std::string(camera.name);
  throw py::value_error("'" + name + "' is not a known camera; known cameras: " + names);
}

Rig kinect_v1(int width, int height) { return resized(known("kinect-v1"), width, height); }

void add_camera(py::module_& m) {
  py::class_<Camera>(
      m, "Camera",
      R"(Camera(width, height, fx, fy, cx=None, cy=None, *, distortion=(), lens='brown_conrady', readout=0.0)
--

Pinhole camera with lens distortion. Camera frame: x right, y down, z forward, as in OpenCV.

width, height: pixels. fx, fy, cx, cy: pixels; (0, 0) is the center of the upper left pixel; default of cx, cy: the
image center. distortion: up to 8 coefficients: k1 k2 p1 p2 k3 k4 k5 k6 of OpenCV for the lens 'brown_conrady', k1 k2
k3 k4 for 'fisheye'. readout: seconds from the first row to the last; 0: global shutter. Raises Error for values out
of range.)")
      .def(
          py::init(&make_camera), py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("fy"),
          py::arg("cx") = std::nullopt, py::arg("cy") = std::nullopt, py::kw_only(),
          py::arg("distortion") = std::vector<double>{}, py::arg("lens") = "brown_conrady", py::arg("readout") = 0.0,
          R"(__init__(self, width, height, fx, fy, cx=None, cy=None, *, distortion=(), lens='brown_conrady', readout=0.0)
--

)")
      .def_readonly("width", &Camera::width, "Pixels.")
      .def_readonly("height", &Camera::height, "Pixels.")
      .def_readonly("fx", &Camera::fx, "Pixels.")
      .def_readonly("fy", &Camera::fy, "Pixels.")
      .def_readonly("cx", &Camera::cx, "Pixels.")
      .def_readonly("cy", &Camera::cy, "Pixels.")
      .def_readonly("readout", &Camera::readout, "Seconds from the first row to the last.")
      .def_property_readonly(
          "lens", [](const Camera& c) { return to_string(c.lens); }, "'brown_conrady' or 'fisheye'.")
      .def_property_readonly(
          "distortion", [](const Camera& c) { return py::tuple(py::cast(c.distortion)); }, "8 coefficients.")
      .def_property_readonly(
          "matrix",
          [](const Camera& c) {
            Eigen::Matrix<double, 3, 3, Eigen::RowMajor> k;
            k << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1;
            return Doubles({3, 3}, k.data());
          },
          "(3, 3) float64, pixels: intrinsic matrix.")
      .def("resized", &resized, py::arg("width"), py::arg("height"), R"(resized(self, width, height)
--

Camera with images of another size and the same aspect ratio.)")
      .def_static("known", &known, py::arg("name"), R"(known(name)
--

A camera with published intrinsics, by its name in known_cameras.)")
      .def(py::self == py::self)
      .def("__repr__", [](const Camera& c) {
        return repr("Camera",
                    {{"width", c.width}, {"height", c.height}, {"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx}, {"cy", c.cy}});
      });
  m.def(
      "known_cameras",
      [] {
        std::map<std::string, std::string> names;
        for (const KnownCamera& camera : known_cameras()) names.emplace(camera.name, camera.of);
        return names;
      },
      R"(known_cameras()
--

Cameras with published intrinsics: a dict from the name for Camera.known to a description.)");
}

void add_sensor(py::module_& m) {
  py::class_<SensorModel>(m, "SensorModel", R"(SensorModel(name='structured_light')
--

Noise model of a depth camera: standard deviation of floor + growth (z - sharpest)^2 meters at a depth of z meters.

name: 'structured_light' (Kinect v1, Xtion), 'time_of_flight' (Azure Kinect), 'stereo' (RealSense D4xx),
'phone_lidar', 'exact' (rendered without noise). Fields are writable.)")
      .def(py::init([](const std::string& name) { return sensor_model(name); }), py::arg("name") = "structured_light",
           R"(__init__(self, name='structured_light')
--

)")
      .def_property_readonly(
          "name", [](const SensorModel& s) { return std::string(to_string(s)); }, "Name of the model, or 'custom'.")
      .def_readwrite("floor", &SensorModel::floor, "Meters.")
      .def_readwrite("growth", &SensorModel::growth, "1/m.")
      .def_readwrite("sharpest", &SensorModel::sharpest, "Meters.")
      .def_readwrite("min_depth", &SensorModel::min_depth, "Meters; nearer measurements are dropped.")
      .def_readwrite("max_depth", &SensorModel::max_depth, "Meters; farther measurements are dropped.")
      .def_readwrite("min_confidence", &SensorModel::min_confidence,
                     "0 to 255; measurements with less confidence are dropped.")
      .def("sigma", &SensorModel::sigma, py::arg("depth"), R"(sigma(self, depth)
--

Standard deviation at a depth, both in meters.)")
      .def("__repr__", [](const SensorModel& s) {
        return repr("SensorModel",
                    {{"name", std::string(to_string(s))}, {"min_depth", s.min_depth}, {"max_depth", s.max_depth}});
      });
}

using Image = py::array_t<float, py::array::c_style | py::array::forcecast>;

Image image_of(const py::object& value, const char* name, const char* unit) {
  auto image = Image::ensure(value);
  if (image && image.ndim() == 2) return image;
  PyErr_Clear();
  throw py::value_error(std::string(name) + " is " + description_of(value) +
                        "; numbers of shape (rows, columns) are expected, " + unit);
}

DepthCorrection make_correction(const py::object& values) {
  const Image offsets = image_of(values, "offsets", "1/m");
  DepthCorrection correction{.columns = static_cast<int>(offsets.shape(1)),
                             .rows = static_cast<int>(offsets.shape(0)),
                             .offsets = {offsets.data(), offsets.data() + offsets.size()}};
  check(correction);
  return correction;
}

py::array corrected(const DepthCorrection& correction, const py::object& values) {
  const Image depth = image_of(values, "depth", "meters");
  const py::ssize_t rows = depth.shape(0), columns = depth.shape(1);
  std::vector<float> image(depth.data(), depth.data() + depth.size());
  correction.apply(static_cast<int>(columns), static_cast<int>(rows), image);
  return moved<float>(std::move(image), {rows, columns});
}

void add_correction(py::module_& m) {
  py::class_<DepthCorrection>(m, "DepthCorrection", R"(DepthCorrection(offsets)
--

Depth correction by image position: 1 / true depth = 1 / measured depth + offset.

offsets: (rows, columns) float32, 1/m, at the centers of a grid of cells that divides the image evenly; at least two
rows and columns. Raises Error for offsets beyond 1/m.)")
      .def(py::init(&make_correction), py::arg("offsets"), R"(__init__(self, offsets)
--

)")
      .def_property_readonly(
          "offsets",
          [](const py::object& self) {
            const auto& c = self.cast<const DepthCorrection&>();
            auto offsets = view(c.offsets.data(), {c.rows, c.columns}, self);
            make_read_only(offsets);
            return offsets;
          },
          "(rows, columns) float32, 1/m. A view of the correction's memory; read-only.")
      .def("at", &DepthCorrection::at, py::arg("x"), py::arg("y"), R"(at(self, x, y)
--

Offset, 1/m, interpolated between nodes. x, y: image position, 0 to 1 of width and height.)")
      .def("apply", &corrected, py::arg("depth"), R"(apply(self, depth)
--

Corrected image, (rows, columns) float32, meters; 0 stays 0.)")
      .def("compose", &DepthCorrection::compose, py::arg("next"), R"(compose(self, next)
--

Composition: this correction, followed by next.)")
      .def(py::self == py::self)
      .def("__repr__", [](const DepthCorrection& c) {
        return repr("DepthCorrection", {{"rows", c.rows}, {"columns", c.columns}});
      });
}

void add_rig(py::module_& m) {
  py::class_<ColorCamera>(m, "ColorCamera", R"(ColorCamera(camera, color_from_depth)
--

Color camera separate from the depth camera.

color_from_depth: (4, 4), from the depth camera's frame to the color camera's, meters.)")
      .def(py::init([](const Camera& camera, const py::object& pose) {
             return ColorCamera{camera, pose_of(pose, "color_from_depth")};
           }),
           py::arg("camera"), py::arg("color_from_depth"), R"(__init__(self, camera, color_from_depth)
--

)")
      .def_readonly("camera", &ColorCamera::camera)
      .def_property_readonly(
          "color_from_depth", [](const ColorCamera& c) { return to_numpy(c.color_from_depth); },
          "(4, 4) float64, meters.");

  py::class_<Rig>(m, "Rig", R"(Rig(depth, color=None, *, sensor=None, camera_from_imu=None, depth_correction=None)
--

Cameras of a sensor. All poses are poses of the depth camera.

depth: its Camera. color: its ColorCamera; None: color images are registered to depth, with the same size and view.
sensor: a SensorModel or its name. camera_from_imu: (4, 4), rotation from the inertial sensor to the depth camera's
frame; None: estimated from the camera motion. depth_correction: a DepthCorrection; None: no correction.)")
      .def(py::init([](const Camera& depth, std::optional<ColorCamera> color, const py::object& sensor,
                       const py::object& camera_from_imu, std::optional<DepthCorrection> depth_correction) {
             Rig rig(depth, std::move(color));
             if (py::isinstance<py::str>(sensor))
               rig.sensor = sensor_model(sensor.cast<std::string>());
             else if (!sensor.is_none())
               rig.sensor = sensor.cast<SensorModel>();
             if (!camera_from_imu.is_none())
               rig.camera_from_imu = Eigen::Quaterniond(pose_of(camera_from_imu, "camera_from_imu").linear());
             if (depth_correction) rig.depth_correction = std::move(*depth_correction);
             check(rig);
             return rig;
           }),
           py::arg("depth"), py::arg("color") = std::nullopt, py::kw_only(), py::arg("sensor") = py::none(),
           py::arg("camera_from_imu") = py::none(), py::arg("depth_correction") = std::nullopt,
           R"(__init__(self, depth, color=None, *, sensor=None, camera_from_imu=None, depth_correction=None)
--

)")
      .def_readonly("depth", &Rig::depth, "The depth camera.")
      .def_readonly("color", &Rig::color, "The separate color camera, or None: color is registered to depth.")
      .def_readonly("sensor", &Rig::sensor, "Noise model of the depth camera.")
      .def_property_readonly(
          "camera_from_imu",
          [](const Rig& rig) {
            return to_numpy(rig.camera_from_imu ? std::optional(Eigen::Isometry3d(*rig.camera_from_imu))
                                                : std::nullopt);
          },
          "(4, 4) float64, rotation from the inertial sensor to the depth camera's frame; or None.")
      .def_property_readonly(
          "depth_correction",
          [](const Rig& rig) {
            return rig.depth_correction.empty() ? std::nullopt : std::optional(rig.depth_correction);
          },
          "A DepthCorrection, or None: no correction.")
      .def_static("kinect_v1", &kinect_v1, py::arg("width") = 640, py::arg("height") = 480,
                  R"(kinect_v1(width=640, height=480)
--

Kinect for Xbox 360, Xtion or PrimeSense without calibration, depth registered to color.)")
      .def_static(
          "known", [](const std::string& name) { return Rig(known(name)); }, py::arg("name"), R"(known(name)
--

A camera with published intrinsics (known_cameras), color registered to depth.)")
      .def_static("read", &read_rig, py::arg("file"), R"(read(file)
--

Reads a camera.yaml. Raises Error with file and line.)")
      .def(
          "write", [](const Rig& rig, const std::filesystem::path& file) { write_rig(file, rig); }, py::arg("file"),
          R"(write(self, file)
--

Writes a camera.yaml, atomically. The depth unit is omitted; it is a property of the recording.)")
      .def(py::self == py::self)
      .def("__repr__", [](const Rig& r) {
        return repr("Rig", {{"depth", r.depth}, {"color", r.color}, {"sensor", r.sensor}});
      });
}

}  // namespace

void add_cameras(py::module_& m) {
  add_camera(m);
  add_sensor(m);
  add_correction(m);
  add_rig(m);
}

}  // namespace cairn::python
