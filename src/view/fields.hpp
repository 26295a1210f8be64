// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Distances, observations and certainty of a map on a coarse grid, for pages: docs/formats.md has the bytes.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/sensor_model.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// Cells side by side, x fastest, then y, then z. World frame, metres.
struct Fields {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();    // cells
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();  // the centre of the first
  float spacing = 0, max_distance = 0;
  std::vector<std::uint8_t> distance;  // 0: nobody looked there; else (v - 128) / 127 of max_distance, as `cairn esdf`
  std::vector<std::uint8_t> weight;    // observations, of the surface where it passes the cell or the next one; 0: none
  std::vector<std::uint8_t> sigma;     // 0.1 mm; standard deviation of the surface that passes there; 0: none
};

/// How many cells there are at most.
inline constexpr std::size_t kMaxFieldCells = 1'000'000;

/// Of a map.vdb, as coarse as it takes for `most` cells. Sites of the surface come from planes through 2x2x2 voxels as
/// in shaders/esdf_sites.comp, distances by propagation of vectors (Danielsson 1980).
///
/// The weight W of a voxel is the sum of its measurements' weights w(z), see SensorModel. A weighted mean of
/// independent measurements has the variance sum(w^2 sigma^2) / W^2 (propagation of errors: Bevington & Robinson
/// 2003, ch. 3). How far the camera was each time nobody kept: the poses of `path` that have the surface before them
/// tell it, so that sigma^2 = [sum(w^2 sigma^2) / sum(w)] over these poses / W. Without a path z is 1 m. What all
/// measurements have in common, such as a wrong calibration, is not in it.
///
/// Throws std::runtime_error for a file that is no map.
[[nodiscard]] Fields make_fields(const std::filesystem::path& vdb, const SensorModel& sensor, const Trajectory& path,
                                 std::size_t most = kMaxFieldCells);

/// As the page reads them.
[[nodiscard]] std::string bytes_of(const Fields& fields);

}  // namespace cairn
