// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include "cairn/mapping/trajectory.hpp"

namespace cairn::python {

/// Trajectory as one Python object.
struct StampedPoses {
  Trajectory poses;
};

}  // namespace cairn::python
