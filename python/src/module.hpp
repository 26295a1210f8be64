// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Parts of the module; each adds its classes and functions.
#pragma once
#include <pybind11/pybind11.h>

namespace cairn::python {

void add_cameras(pybind11::module_& m);
void add_trajectory(pybind11::module_& m);
void add_frames(pybind11::module_& m);
void add_sources(pybind11::module_& m);
void add_calibrate(pybind11::module_& m);
void add_options(pybind11::module_& m);
void add_reports(pybind11::module_& m);
void add_mesh(pybind11::module_& m);
void add_distances(pybind11::module_& m);
void add_map(pybind11::module_& m);
void add_mapper(pybind11::module_& m);
void add_live_surface(pybind11::module_& m);
void add_viewers(pybind11::module_& m);
void add_session(pybind11::module_& m);
void add_localizer(pybind11::module_& m);
void add_graph(pybind11::module_& m);
void add_evaluation(pybind11::module_& m);
void add_splats(pybind11::module_& m);
void add_synthetic(pybind11::module_& m);

}  // namespace cairn::python
