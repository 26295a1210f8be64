// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Plane pictures of a distance field.
#pragma once
#include <filesystem>

#include "cairn/esdf.hpp"
#include "cairn/mesh.hpp"

namespace cairn::apps {

/// The plane axis = `at` (metres; axis 0 to 2) with a legend, as PNG.
void write_slice(const std::filesystem::path& png, const DistanceField& field, int axis, float at);

/// Metres above the map's origin.
struct Band {
  float low = 0, high = 0;
};
/// Occupancy as ROS map_server reads it: the .yaml and a .pgm beside it. A cell is occupied when a surface passes it in
/// the band, free when at least half of the band is known and nothing is in the way, else unknown. `field` and
/// `surface` are of the same map.
void write_costmap(const std::filesystem::path& yaml, const DistanceField& field, const Mesh& surface,
                   const Band& band);

}  // namespace cairn::apps
