// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/trajectory.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "module.hpp"
#include "numpy.hpp"
#include "trajectory.hpp"

namespace cairn::python {

namespace {

Trajectory trajectory_of(const py::handle& times, const py::handle& poses) {
  const auto stamps = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(times);
  const auto matrices = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(poses);
  if (!stamps || stamps.ndim() != 1) {
    PyErr_Clear();
    throw py::value_error("times is " + description_of(times) + "; (N,) numbers are expected, in seconds");
  }
  if (!matrices || matrices.ndim() != 3 || matrices.shape(0) != stamps.shape(0)) {
    PyErr_Clear();
    throw py::value_error("poses is " + description_of(poses) + "; (" + std::to_string(stamps.shape(0)) +
                          ", 4, 4) is expected");
  }
  Trajectory trajectory;
  for (py::ssize_t i = 0; i < stamps.shape(0); ++i) {
    if (i > 0 && !(stamps.at(i) > stamps.at(i - 1)))
      throw py::value_error("times do not increase from " + std::to_string(stamps.at(i - 1)) + " to " +
                            std::to_string(stamps.at(i)));
    trajectory.push_back({stamps.at(i), pose_of(matrices[py::int_(i)], "a pose")});
  }
  return trajectory;
}

/// View of the time stamps, without a copy.
py::array_t<double> times_of(const py::object& self) {
  const auto& poses = self.cast<const StampedPoses&>().poses;
  return py::array_t<double>({static_cast<py::ssize_t>(poses.size())}, {static_cast<py::ssize_t>(sizeof(StampedPose))},
                             poses.empty() ? nullptr : &poses[0].timestamp, self);
}

py::array_t<double> matrices_of(const py::object& self) {
  const auto& poses = self.cast<const StampedPoses&>().poses;
  constexpr auto kNumber = static_cast<py::ssize_t>(sizeof(double));
  return py::array_t<double>({static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}},
                             {static_cast<py::ssize_t>(sizeof(StampedPose)), kNumber, 4 * kNumber},
                             poses.empty() ? nullptr : poses[0].world_from_camera.data(), self);
}

}  // namespace

void add_trajectory(py::module_& m) {
  py::class_<StampedPoses>(m, "Trajectory", R"(Trajectory(times, poses)
--

Poses of the depth camera, by increasing time.

times: (N,), seconds. poses: (N, 4, 4), world_from_camera, meters.)")
      .def(py::init([](const py::object& times, const py::object& poses) {
             return StampedPoses{trajectory_of(times, poses)};
           }),
           py::arg("times"), py::arg("poses"), R"(__init__(self, times, poses)
--

)")
      .def_property_readonly("times", &times_of, "(N,) float64, seconds. A view of the trajectory's memory.")
      .def_property_readonly("poses", &matrices_of,
                             "(N, 4, 4) float64, world_from_camera, meters. A view of the trajectory's memory.")
      .def("__len__", [](const StampedPoses& t) { return t.poses.size(); })
      .def(
          "at",
          [](const StampedPoses& t, double time, double max_gap) { return to_numpy(pose_at(t.poses, time, max_gap)); },
          py::arg("time"), py::arg("max_gap") = 0.1, R"(at(self, time, max_gap=0.1)
--

Pose at a time, (4, 4) float64, interpolated between poses at most max_gap seconds apart; None without such poses.)")
      .def_static(
          "read", [](const std::filesystem::path& file) { return StampedPoses{read_trajectory(file)}; },
          py::arg("file"), R"(read(file)
--

Reads the TUM format, 't tx ty tz qx qy qz qw' per line. Raises Error with file and line.)")
      .def(
          "write", [](const StampedPoses& t, const std::filesystem::path& file) { write_trajectory(file, t.poses); },
          py::arg("file"), R"(write(self, file)
--

Writes the TUM format, atomically.)")
      .def("__repr__",
           [](const StampedPoses& t) { return "Trajectory of " + std::to_string(t.poses.size()) + " poses"; });
}

}  // namespace cairn::python
