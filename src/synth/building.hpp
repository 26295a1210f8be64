// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A building of storeys with corridors, offices that look alike, and a staircase at each end; and people who scan parts
// of it, one recording each.
#pragma once
#include <string_view>

#include "cairn/scene.hpp"

namespace cairn {

struct BuildingOptions {
  int floors = 3;
  int rooms = 40;      // in all storeys together
  int recording = 0;   // which of them: where it leads, which doors are open, how the hand shakes
  double metres = 30;  // that it leads
};

/// Reads `floors=3&rooms=40&recording=0&metres=30` or a part of it. Throws std::runtime_error naming what is wrong.
[[nodiscard]] BuildingOptions building_options(std::string_view query);

/// The building as one recording meets it. All recordings of it have one world frame: x along the corridors, 0 where
/// they begin; the lowest storey's floor 1.3 m below the origin, storeys 3 m high.
[[nodiscard]] Scene building(const BuildingOptions& options);

}  // namespace cairn
