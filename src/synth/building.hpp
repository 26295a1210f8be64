// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Building of storeys with corridors, identical offices, and a staircase at each end, scanned in parts by several
// people, one recording each.
#pragma once
#include <string_view>

#include "cairn/synthetic/scene.hpp"

namespace cairn {

struct BuildingOptions {
  int floors = 3;
  int rooms = 40;      // in all storeys together
  int recording = 0;   // index: determines path, open doors and hand motion
  double meters = 30;  // length of the path
};

/// Parses `floors=3&rooms=40&recording=0&meters=30` or a part of it. Throws std::runtime_error with the invalid entry.
[[nodiscard]] BuildingOptions building_options(std::string_view query);

/// Building in the state of one recording. All recordings have the same world frame: x along the corridors, 0 at their
/// start; the lowest storey's floor 1.3 m below the origin, storeys 3 m high.
[[nodiscard]] Scene building(const BuildingOptions& options);

}  // namespace cairn
