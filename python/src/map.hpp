// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include <memory>
#include <optional>

#include "cairn/map.hpp"
#include "guard.hpp"

namespace cairn::python {

/// A map beside whose mapper nothing else is called.
struct GuardedMap {
  Map map;
  std::shared_ptr<Guard> guard;
};

/// The options of a field, where any is given.
[[nodiscard]] std::optional<EsdfOptions> distance_options(std::optional<float> voxel_size,
                                                          std::optional<float> max_distance,
                                                          std::optional<float> robot_radius,
                                                          const EsdfOptions& otherwise);

}  // namespace cairn::python
