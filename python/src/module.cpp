// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "module.hpp"

#include <pybind11/stl.h>

#include <stdexcept>

#include "cairn/mapping/device.hpp"
#include "text.hpp"

namespace cairn::python {
namespace {

void add_errors(py::module_& m) {
  static py::handle error;  // lives as long as the interpreter
  error = PyErr_NewExceptionWithDoc("cairn.Error",
                                    "A failure outside of the program, in one line: cause, place and remedy, as in the "
                                    "program `cairn`.",
                                    PyExc_RuntimeError, nullptr);
  m.attr("Error") = error;
  py::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const py::builtin_exception&) {
      throw;  // the module's own: pybind11 translates it
    } catch (const std::runtime_error& e) {
      PyErr_SetString(error.ptr(), e.what());
    }
  });
}

void add_devices(py::module_& m) {
  py::class_<DeviceInfo>(m, "Device", "A Vulkan device.")
      .def_readonly("index", &DeviceInfo::index, "Argument `device` of Mapper.")
      .def_readonly("name", &DeviceInfo::name)
      .def_readonly("type", &DeviceInfo::type, "discrete, integrated, cpu, ...")
      .def_readonly("driver", &DeviceInfo::driver)
      .def_readonly("memory", &DeviceInfo::memory, "Bytes of the largest heap on the device.")
      .def_readonly("missing", &DeviceInfo::missing, "Required features that the device lacks, or None.")
      .def("__repr__", [](const DeviceInfo& d) {
        return repr("Device", {{"index", d.index}, {"name", d.name}, {"type", d.type}});
      });
  m.def(
      "devices",
      [] {
        const py::gil_scoped_release release;
        return list_devices();
      },
      R"(devices()
--

All Vulkan devices, usable or not, as a list of Device. Empty without a driver.)");
}

}  // namespace
}  // namespace cairn::python

PYBIND11_MODULE(_cairn, m) {
  pybind11::options texts;
  texts.disable_function_signatures();  // each docstring has its own signature in Python's notation
  m.doc() = "Cairn's C++ library. Import cairn instead.";
  m.attr("__version__") = CAIRN_VERSION;
  using namespace cairn::python;
  add_errors(m);
  add_devices(m);
  add_cameras(m);
  add_trajectory(m);
  add_frames(m);
  add_sources(m);
  add_calibrate(m);
  add_options(m);
  add_reports(m);
  add_mesh(m);
  add_distances(m);
  add_map(m);
  add_mapper(m);
  add_live_surface(m);
  add_viewers(m);
  add_session(m);
  add_localizer(m);
  add_graph(m);
  add_evaluation(m);
  add_splats(m);
  add_synthetic(m);
}
