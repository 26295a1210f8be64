// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Distance, weight and uncertainty of a map on a coarse grid, for the web page; docs/outputs.md describes the bytes.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/mapping/sensor_model.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Cell grid, x fastest, then y, then z. World frame, meters.
struct Fields {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();    // cells
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();  // center of the first cell
  float spacing = 0, max_distance = 0;
  std::vector<std::uint8_t> distance;  // 0: unknown; else (v - 128) / 127 of max_distance, as in `cairn esdf`
  std::vector<std::uint8_t> weight;    // observations, of the surface in the cell or in an adjacent cell; 0: none
  std::vector<std::uint8_t> sigma;     // 0.1 mm; standard deviation of the surface in the cell; 0: none
};

/// Maximum number of cells.
inline constexpr std::size_t kMaxFieldCells = 1'000'000;

/// Fields of a map.vdb, at the finest resolution with at most `max_cells` cells. Surface points come from planes
/// through 2x2x2 voxels as in shaders/esdf_sites.comp, distances from vector propagation (Danielsson 1980).
///
/// The weight W of a voxel is the sum of the weights w(z) of its measurements, see SensorModel. A weighted mean of
/// independent measurements has the variance sum(w^2 sigma^2) / W^2 (propagation of errors: Bevington & Robinson 2003,
/// ch. 3). The map does not store the distances z. They are estimated from the poses of `path` with the surface in
/// view, so that sigma^2 = [sum(w^2 sigma^2) / sum(w)] over these poses / W. Without a path, z is 1 m. Errors common to
/// all measurements, such as a wrong calibration, are not included.
///
/// Throws std::runtime_error for a file that is not a map.
[[nodiscard]] Fields make_fields(const std::filesystem::path& vdb, const SensorModel& sensor, const Trajectory& path,
                                 std::size_t max_cells = kMaxFieldCells);

/// Serializes the fields for the page.
[[nodiscard]] std::string bytes_of(const Fields& fields);

}  // namespace cairn
