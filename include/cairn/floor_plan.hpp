// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Floor plans of a map, to scale.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

struct PlanOptions {
  float height = 1.2f;  ///< metres above each floor, where walls are cut
  int scale = 0;        ///< 1:scale; 0: 1:50 where that fits on A3, else the first of 1:100, 1:200 and 1:500 that fits
                        ///< on A0
  bool path = false;    ///< the camera's path is drawn, too
  std::string title;    ///< what was recorded, as the plan names it
};

/// Throws std::runtime_error naming the option, its value and the allowed range, or a kind of file that is none.
void check(const PlanOptions& options, const std::filesystem::path& file);

/// A storey, and how well its plan agrees with the map.
struct ExportedStorey {
  double floor = 0;           ///< metres along the world's -y
  double floor_area = 0;      ///< m2 that were seen
  std::vector<double> rooms;  ///< m2, of those that are closed, the largest first
  double walls = 0;           ///< metres of surface that is cut and drawn
  /// Metres between that surface and the lines in its place: on the mean, for 95 % of its length, at most.
  double mean_off = 0, p95_off = 0, max_off = 0;
};

/// What was drawn.
struct ExportedPlan {
  int scale = 0;
  std::string paper;                         ///< A4 to A0; empty: larger
  double width_mm = 0, height_mm = 0;        ///< of the page
  std::vector<ExportedStorey> storeys;       ///< the lowest first
  std::vector<std::filesystem::path> files;  ///< that were written
};

}  // namespace cairn
