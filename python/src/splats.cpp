// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/splats.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "cairn/io/source.hpp"
#include "cairn/mapping/splat_training.hpp"
#include "map.hpp"
#include "module.hpp"
#include "numpy.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

py::ssize_t count(const auto& list) { return static_cast<py::ssize_t>(list.size()); }

/// View of a list of vectors, (N, columns).
template <class List>
py::object column(const py::object& self, const List& list, py::ssize_t columns) {
  return view(reinterpret_cast<const float*>(list.data()), {count(list), columns}, self);
}

/// Calls `progress` (None or callable) with the step and the PSNR, and checks for Ctrl-C. A false result ends the
/// training.
SplatStep step_of(const py::object& progress) {
  return [&progress](const SplatProgress& p) {
    const py::gil_scoped_acquire acquire;
    check_signals();
    if (progress.is_none()) return true;
    const py::object result = progress(p.iteration, p.psnr, p.splats);
    return result.is_none() || result.cast<bool>();
  };
}

py::tuple train(GuardedMap& map, const std::optional<std::filesystem::path>& recording, const SplatOptions& options,
                const py::object& progress) {
  OpenRecording open;
  if (recording) open = [&] { return read_ahead(open_source(recording->string())); };
  const SplatStep step = step_of(progress);
  TrainedSplats trained = map.guard->run([&] { return train_splats(map.map, options, step, open); });
  return py::make_tuple(std::move(trained.splats), trained.report);
}

void add_report(py::module_& m) {
  py::class_<SplatReport>(m, "SplatReport", "Result of train_splats.")
      .def_readonly("iterations", &SplatReport::iterations)
      .def_readonly("images", &SplatReport::images, "Number of training images.")
      .def_readonly("psnr", &SplatReport::psnr, "dB, over recent training images at their size.")
      .def_readonly("seconds", &SplatReport::seconds, "Of training.")
      .def_readonly("memory", &SplatReport::memory, "Bytes, estimated: of host and device together.")
      .def_readonly("problem", &SplatReport::problem, "Reason why held-out images could not be compared, or empty.")
      .def_readonly("held_out", &SplatReport::held_out, "ViewError of the splats against held-out images, or None.")
      .def_readonly("mesh", &SplatReport::mesh, "ViewError of the mesh against the same images, or None.")
      .def("__repr__", [](const SplatReport& r) {
        return repr("SplatReport", {{"iterations", r.iterations}, {"images", r.images}, {"psnr", r.psnr}});
      });
}

}  // namespace

void add_splats(py::module_& m) {
  py::class_<Splats>(m, "Splats",
                     "Gaussian splats in the map's world frame. Arrays are writable views of their memory and keep "
                     "the splats alive.")
      .def_property_readonly(
          "positions", [](const py::object& self) { return column(self, self.cast<const Splats&>().positions, 3); },
          "(N, 3) float32, meters.")
      .def_property_readonly(
          "log_scales", [](const py::object& self) { return column(self, self.cast<const Splats&>().log_scales, 3); },
          "(N, 3) float32: natural logarithm of the standard deviations along the axes, meters.")
      .def_property_readonly(
          "rotations", [](const py::object& self) { return column(self, self.cast<const Splats&>().rotations, 4); },
          "(N, 4) float32: quaternion w, x, y, z; not normalized.")
      .def_property_readonly(
          "opacities",
          [](const py::object& self) {
            const auto& opacities = self.cast<const Splats&>().opacities;
            return view(opacities.data(), {count(opacities)}, self);
          },
          "(N,) float32: logit.")
      .def_property_readonly(
          "colors", [](const py::object& self) { return column(self, self.cast<const Splats&>().colors, 3); },
          "(N, 3) float32: R, G, B in 0..1 are 0.5 + 0.28209479 * colors.")
      .def_property_readonly(
          "harmonics",
          [](const py::object& self) {
            const auto& splats = self.cast<const Splats&>();
            return view(reinterpret_cast<const float*>(splats.harmonics.data()),
                        {count(splats.positions), static_cast<py::ssize_t>(harmonics_per_splat(splats.degree)), 3},
                        self);
          },
          "(N, K, 3) float32: spherical harmonics of degree 1 and above; K is 0, 3, 8 or 15.")
      .def_readonly("degree", &Splats::degree)
      .def_static(
          "read",
          [](const std::filesystem::path& file) {
            const py::gil_scoped_release release;
            return read_splats(file);
          },
          py::arg("file"), R"(read(file)
--

Reads a .ply or .spz file.)")
      .def(
          "write",
          [](const Splats& splats, const std::filesystem::path& file) {
            const py::gil_scoped_release release;
            write_splats(file, splats);
          },
          py::arg("file"), R"(write(self, file)
--

Writes a .spz, or without quantization a .ply or .glb. Atomic.)")
      .def("__len__", &Splats::size)
      .def("__repr__", [](const Splats& s) {
        return repr("Splats", {{"splats", s.size()}, {"degree", s.degree}});
      });
  add_report(m);
  const SplatOptions defaults;
  m.def(
      "train_splats",
      [](GuardedMap& map, const std::optional<std::filesystem::path>& recording, int iterations, double seconds,
         float resolution, std::size_t max_splats, int degree, int images, int hold_out,
         const std::filesystem::path& mesh, const py::object& progress) {
        return train(map, recording,
                     {.iterations = iterations,
                      .max_seconds = seconds,
                      .resolution = resolution,
                      .max_splats = max_splats,
                      .degree = degree,
                      .images = images,
                      .hold_out = hold_out,
                      .mesh = mesh},
                     progress);
      },
      py::arg("map"), py::arg("recording") = py::none(), py::kw_only(), py::arg("iterations") = defaults.iterations,
      py::arg("seconds") = defaults.max_seconds, py::arg("resolution") = defaults.resolution,
      py::arg("max_splats") = defaults.max_splats, py::arg("degree") = defaults.degree,
      py::arg("images") = defaults.images, py::arg("hold_out") = defaults.hold_out, py::arg("mesh") = "",
      py::arg("progress") = py::none(),
      R"(train_splats(map, recording=None, *, iterations=7000, seconds=0, resolution=0.5, max_splats=300000, degree=1, images=300, hold_out=10, mesh='', progress=None)
--

Trains Gaussian splats from a map's keyframes, or from the frames of its last recording, given by name. Returns Splats
and a SplatReport.

iterations: steps, an image each. seconds: time limit; 0: none. resolution: size of the training images, relative to
the color images. degree: of the spherical harmonics, 0 to 3. images: maximum number from a recording. hold_out: every
N-th image is compared in the end instead; 0: none. mesh: file compared with the same images. progress: called with
the step, the PSNR in dB and the number of splats; False ends the training.)");
}

}  // namespace cairn::python
