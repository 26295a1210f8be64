// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/calibrate.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <utility>

#include "cairn/source.hpp"
#include "frames.hpp"
#include "module.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

using Opener = std::function<std::unique_ptr<Source>()>;

/// Adapts a Source of cairn.open for the library.
class OpenedSource final : public Source {
 public:
  explicit OpenedSource(py::object opened) : opened_(std::move(opened)), source_(opened_.cast<GuardedSource&>()) {}
  ~OpenedSource() override {
    const py::gil_scoped_acquire acquire;
    opened_ = {};
  }
  OpenedSource(const OpenedSource&) = delete;
  OpenedSource& operator=(const OpenedSource&) = delete;
  const Rig& rig() const override { return source_.source->rig(); }
  std::optional<int> size() const override { return source_.size; }
  std::optional<Frame> next() override {
    const py::gil_scoped_acquire acquire;
    auto next = source_.next();
    if (!next) return std::nullopt;
    return std::move(next->frame);
  }

 private:
  py::object opened_;
  GuardedSource& source_;
};

/// Opens a recording by its name or by a function.
Opener opener(const py::object& recording) {
  if (PyCallable_Check(recording.ptr()) != 0)
    return [&recording]() -> std::unique_ptr<Source> {
      const py::gil_scoped_acquire acquire;
      py::object opened = recording();
      if (!py::isinstance<GuardedSource>(opened))
        throw py::type_error("recording() gave " + told(opened) + "; a Source is expected, as cairn.open gives it");
      return std::make_unique<OpenedSource>(std::move(opened));
    };
  if (!py::isinstance<py::str>(recording) && !py::hasattr(recording, "__fspath__"))
    throw py::type_error("recording is " + told(recording) +
                         "; a name as for cairn.open, or a function that opens a Source each time, is expected");
  return [name = recording.cast<std::filesystem::path>().string(), options = SourceOptions{}]() mutable {
    auto source = open_source(name, options);
    options.find_colour_camera = false;  // takes seconds, and the first source's rig is known
    return source;
  };
}

template <class Find>
auto found(const Find& find, const py::object& recording, const py::object& progress) {
  const Opener open = opener(recording);
  int frames = 0;
  const auto step = [&] {
    const py::gil_scoped_acquire acquire;
    check_signals();
    if (!progress.is_none()) progress(++frames);
  };
  const py::gil_scoped_release release;
  return find(open, step);
}

void add_results(py::module_& m) {
  constexpr const char* kRig = "The source's, with what was found: a camera.yaml once it is written.";
  constexpr const char* kBetter =
      "Share by which surfaces that were held out are predicted better with it than without.";
  constexpr const char* kKeyframes = "That it was found with.";
  constexpr const char* kWhyNot = "In one line; empty: it was found.";
  py::class_<FoundShutter>(m, "FoundShutter", "How long a camera takes to read the rows of an image.")
      .def_readonly("rig", &FoundShutter::rig, kRig)
      .def_readonly("readout", &FoundShutter::readout, "Seconds from the first row to the last; 0: none was found.")
      .def_readonly("sigma", &FoundShutter::sigma, "Seconds, its standard deviation.")
      .def_readonly("predicts_better", &FoundShutter::predicts_better, kBetter)
      .def_readonly("keyframes", &FoundShutter::keyframes, kKeyframes)
      .def_readonly("why_not", &FoundShutter::why_not, kWhyNot)
      .def("__repr__", [](const FoundShutter& f) {
        return repr("FoundShutter", {{"readout", f.readout}, {"sigma", f.sigma}, {"why_not", f.why_not}});
      });
  py::class_<FoundDepthCorrection>(m, "FoundDepthCorrection", "What a depth camera errs by.")
      .def_readonly("rig", &FoundDepthCorrection::rig, kRig)
      .def_readonly("predicts_better", &FoundDepthCorrection::predicts_better, kBetter)
      .def_readonly("keyframes", &FoundDepthCorrection::keyframes, kKeyframes)
      .def_readonly("why_not", &FoundDepthCorrection::why_not, kWhyNot)
      .def("__repr__", [](const FoundDepthCorrection& f) {
        return repr("FoundDepthCorrection", {{"predicts_better", f.predicts_better}, {"why_not", f.why_not}});
      });
  py::class_<FoundCalibration>(m, "FoundCalibration", "What the cameras of a sensor are.")
      .def_readonly("rig", &FoundCalibration::rig, kRig)
      .def_readonly("clock_offset", &FoundCalibration::clock_offset,
                    "Seconds that the color camera's clock is ahead; tracking finds it in each run.")
      .def_readonly("readout_sigma", &FoundCalibration::readout_sigma,
                    "Seconds, the standard deviation of the readout.")
      .def_readonly("predicts_better", &FoundCalibration::predicts_better, kBetter)
      .def_readonly("keyframes", &FoundCalibration::keyframes, kKeyframes)
      .def_readonly("why_not", &FoundCalibration::why_not, kWhyNot)
      .def("__repr__", [](const FoundCalibration& f) {
        return repr("FoundCalibration", {{"rig", f.rig}, {"why_not", f.why_not}});
      });
}

}  // namespace

void add_calibrate(py::module_& m) {
  m.def(
      "find_color_camera",
      [](GuardedSource& source, int frames) {
        return source.guard->run([&] { return find_colour_camera(*source.source, frames); });
      },
      py::arg("source"), py::arg("frames") = 40, R"(find_color_camera(source, frames=40)
--

Calibrates: finds the color camera from the edges of depth and of color, in frames spread over all of a Source, which is
read to its end. Returns the Rig, or None where no camera does better than what was told or too few edges are seen.)");
  add_results(m);
  m.def(
      "find_shutter",
      [](const py::object& recording, const py::object& progress) { return found(find_shutter, recording, progress); },
      py::arg("recording"), py::kw_only(), py::arg("progress") = py::none(),
      R"(find_shutter(recording, *, progress=None)
--

Calibrates: finds how long both cameras take to read their rows, by tracking the recording, which must turn quickly, and
adjusting keyframes, surface and readout together, up to three times. Returns a FoundShutter, which says why where it is
not believed: it must predict measurements that it was not found with.

recording: a name as for cairn.open, or a function that opens it as a Source, each time from its begin. progress: called
with the number of frames that were tracked so far. The same frames give the same readout.)");
  m.def(
      "find_depth_correction",
      [](const py::object& recording, const py::object& progress) {
        return found(find_depth_correction, recording, progress);
      },
      py::arg("recording"), py::kw_only(), py::arg("progress") = py::none(),
      R"(find_depth_correction(recording, *, progress=None)
--

Calibrates: finds what the depth camera errs by, by tracking the recording twice and adjusting keyframes, surface and
correction together. Returns a FoundDepthCorrection; recording and progress are as for find_shutter.)");
  m.def(
      "find_calibration",
      [](const py::object& recording, const py::object& progress) {
        return found(find_calibration, recording, progress);
      },
      py::arg("recording"), py::kw_only(), py::arg("progress") = py::none(),
      R"(find_calibration(recording, *, progress=None)
--

Calibrates: finds focal lengths, principal points, the first radial term of lenses, where the color camera is, the
readout of rows and what depth errs by, all together, by tracking the recording once. Returns a FoundCalibration, which
says why where nothing is believed; recording and progress are as for find_shutter.)");
}

}  // namespace cairn::python
