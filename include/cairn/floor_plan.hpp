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
  bool path = false;    ///< the camera's path is drawn, too: of several recordings each in a colour
  bool loops = false;   ///< lines between places that were recognised as the same
  bool coverage = false;                ///< marks where nobody looked, see ExportedStorey::not_looked_at
  std::string title;                    ///< what was recorded, as the plan names it
  std::vector<std::string> recordings;  ///< what their paths are named; those without a name are numbered from 0
  std::vector<std::string> missing;     ///< recordings that are not in the map, or not whole; named in red
};

/// Throws std::runtime_error naming the option, its value and the allowed range, or a kind of file that is none.
void check(const PlanOptions& options, const std::filesystem::path& file);

/// A storey, and how well its plan agrees with the map.
struct ExportedStorey {
  double floor = 0;           ///< metres along the world's -y
  double floor_area = 0;      ///< m2 that were seen
  std::vector<double> rooms;  ///< m2, of those that are closed, the largest first
  /// m2 within the building's outline, and their share of what there is of floor, where from the floor to the cut
  /// neither free space nor a surface was seen: with PlanOptions::coverage.
  double not_looked_at = 0, not_looked_at_share = 0;
  double walls = 0;  ///< metres of surface that is cut and drawn
  /// Metres between that surface and the lines in its place: on the mean, for 95 % of its length, at most.
  double mean_off = 0, p95_off = 0, max_off = 0;
};

/// What was drawn.
struct ExportedPlan {
  int scale = 0;
  std::string paper;                         ///< A4 to A0; empty: larger
  double width_mm = 0, height_mm = 0;        ///< of the page
  std::vector<ExportedStorey> storeys;       ///< the lowest first
  int loops = 0, loops_between = 0;          ///< that are drawn: all, and those between two recordings
  std::vector<std::filesystem::path> files;  ///< that were written
};

}  // namespace cairn
