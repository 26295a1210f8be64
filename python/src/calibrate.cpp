// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/calibrate.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <utility>

#include "cairn/io/find_color_camera.hpp"
#include "cairn/io/source.hpp"
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
        throw py::type_error("recording() returned " + description_of(opened) + "; a Source of cairn.open is expected");
      return std::make_unique<OpenedSource>(std::move(opened));
    };
  if (!py::isinstance<py::str>(recording) && !py::hasattr(recording, "__fspath__"))
    throw py::type_error("recording is " + description_of(recording) +
                         "; a name as for cairn.open is expected, or a function that opens a Source");
  return [name = recording.cast<std::filesystem::path>().string(), options = SourceOptions{}]() mutable {
    auto source = open_source(name, options);
    options.find_color_camera = false;  // takes seconds, and the first source's rig is known
    return source;
  };
}

template <class Find>
auto estimate(const Find& find, const py::object& recording, const py::object& progress) {
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
  constexpr const char* kRig = "Rig of the source with the estimate; Rig.write writes it as a camera.yaml.";
  constexpr const char* kErrorReduction = "Relative reduction of the prediction error of held-out surfaces.";
  constexpr const char* kKeyframes = "Number of keyframes used.";
  constexpr const char* kFailureReason = "Reason for a rejected estimate, in one line; empty: accepted.";
  py::class_<FoundShutter>(m, "FoundShutter", "Readout time of a rolling shutter: result of find_shutter.")
      .def_readonly("rig", &FoundShutter::rig, kRig)
      .def_readonly("readout", &FoundShutter::readout, "Seconds from the first row to the last; 0: rejected.")
      .def_readonly("sigma", &FoundShutter::sigma, "Standard deviation of the readout, seconds.")
      .def_readonly("error_reduction", &FoundShutter::error_reduction, kErrorReduction)
      .def_readonly("keyframes", &FoundShutter::keyframes, kKeyframes)
      .def_readonly("failure_reason", &FoundShutter::failure_reason, kFailureReason)
      .def("__repr__", [](const FoundShutter& f) {
        return repr("FoundShutter", {{"readout", f.readout}, {"sigma", f.sigma}, {"failure_reason", f.failure_reason}});
      });
  py::class_<FoundDepthCorrection>(m, "FoundDepthCorrection",
                                   "Depth correction of a depth camera: result of find_depth_correction.")
      .def_readonly("rig", &FoundDepthCorrection::rig, kRig)
      .def_readonly("error_reduction", &FoundDepthCorrection::error_reduction, kErrorReduction)
      .def_readonly("keyframes", &FoundDepthCorrection::keyframes, kKeyframes)
      .def_readonly("failure_reason", &FoundDepthCorrection::failure_reason, kFailureReason)
      .def("__repr__", [](const FoundDepthCorrection& f) {
        return repr("FoundDepthCorrection",
                    {{"error_reduction", f.error_reduction}, {"failure_reason", f.failure_reason}});
      });
  py::class_<FoundCalibration>(m, "FoundCalibration", "Calibration of a sensor's cameras: result of find_calibration.")
      .def_readonly("rig", &FoundCalibration::rig, kRig)
      .def_readonly("clock_offset", &FoundCalibration::clock_offset,
                    "Seconds by which the color camera's clock is ahead; tracking estimates it in each run.")
      .def_readonly("readout_sigma", &FoundCalibration::readout_sigma, "Standard deviation of the readout, seconds.")
      .def_readonly("error_reduction", &FoundCalibration::error_reduction, kErrorReduction)
      .def_readonly("keyframes", &FoundCalibration::keyframes, kKeyframes)
      .def_readonly("failure_reason", &FoundCalibration::failure_reason, kFailureReason)
      .def("__repr__", [](const FoundCalibration& f) {
        return repr("FoundCalibration", {{"rig", f.rig}, {"failure_reason", f.failure_reason}});
      });
}

}  // namespace

void add_calibrate(py::module_& m) {
  m.def(
      "find_color_camera",
      [](GuardedSource& source, int frames) {
        return source.guard->run([&] { return find_color_camera(*source.source, frames); });
      },
      py::arg("source"), py::arg("frames") = 40, R"(find_color_camera(source, frames=40)
--

Estimates the color camera's intrinsics and its pose in the rig from edges of depth and color images. Uses `frames`
frames spread over a Source, and reads it to its end. Returns the Rig, or None if no estimate fits better than the
given rig or too few edges are visible.)");
  add_results(m);
  m.def(
      "find_shutter",
      [](const py::object& recording, const py::object& progress) {
        return estimate(find_shutter, recording, progress);
      },
      py::arg("recording"), py::kw_only(), py::arg("progress") = py::none(),
      R"(find_shutter(recording, *, progress=None)
--

Estimates the readout time of both cameras: tracks a recording with fast rotations, and adjusts keyframes, surface and
readout jointly, up to three times. Returns a FoundShutter. The estimate is accepted only if it improves the
prediction of held-out measurements. Deterministic.

recording: a name as for cairn.open, or a function that opens the recording as a Source, each time from its start.
progress: called with the number of tracked frames.)");
  m.def(
      "find_depth_correction",
      [](const py::object& recording, const py::object& progress) {
        return estimate(find_depth_correction, recording, progress);
      },
      py::arg("recording"), py::kw_only(), py::arg("progress") = py::none(),
      R"(find_depth_correction(recording, *, progress=None)
--

Estimates the depth correction: tracks the recording twice, and adjusts keyframes, surface and correction jointly.
Returns a FoundDepthCorrection. recording, progress: as for find_shutter.)");
  m.def(
      "find_calibration",
      [](const py::object& recording, const py::object& progress) {
        return estimate(find_calibration, recording, progress);
      },
      py::arg("recording"), py::kw_only(), py::arg("progress") = py::none(),
      R"(find_calibration(recording, *, progress=None)
--

Estimates jointly focal lengths, principal points, the first radial distortion term, the pose of the color camera, the
readout time and the depth correction; tracks the recording once. Returns a FoundCalibration. recording, progress: as
for find_shutter.)");
}

}  // namespace cairn::python
