// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <pybind11/pybind11.h>

#include <memory>
#include <optional>

#include "cairn/mapping/map.hpp"
#include "guard.hpp"

namespace cairn::python {

/// Map, serialized with the calls to its mapper.
struct GuardedMap {
  Map map;
  std::shared_ptr<Guard> guard;
};

/// Options of a field if any is given.
[[nodiscard]] std::optional<EsdfOptions> distance_options(std::optional<float> voxel_size,
                                                          std::optional<float> max_distance,
                                                          std::optional<float> robot_radius,
                                                          const EsdfOptions& otherwise);

}  // namespace cairn::python
