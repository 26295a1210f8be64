// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include <functional>
#include <memory>
#include <optional>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "cairn/mapping/voxels.hpp"
#include "guard.hpp"

namespace cairn::python {

/// Wrapper, since pybind11 holds no pointers to const.
struct Field {
  std::shared_ptr<const DistanceField> field;
};

/// Distances, gradients and known flags at points of any shape (..., 3).
[[nodiscard]] py::tuple query(const DistanceField& field, const py::object& points);

/// Result of `distances`: a field, or with points the distances at the points.
[[nodiscard]] py::object distances(
    Guard& guard, const py::object& points, const std::optional<EsdfOptions>& options, const py::object& visited,
    const std::function<std::shared_ptr<const DistanceField>(const std::optional<EsdfOptions>&, const Trajectory&)>&
        make);

}  // namespace cairn::python
