// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Floor plans of a map, drawn to scale.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn {

struct PlanOptions {
  float height = 1.2f;  ///< meters above each floor of the horizontal cut through the walls
  int scale = 0;        ///< 1:scale; 0: 1:50 if it fits on A3, else the first of 1:100, 1:200 and 1:500 that fits on A0
  bool path = false;    ///< draws the camera path, in a separate color for each recording
  bool loops = false;   ///< draws lines between the keyframes of loop closures
  bool coverage = false;                ///< marks unobserved areas, see ExportedStorey::unobserved_area
  std::string title;                    ///< title of the plan
  std::vector<std::string> recordings;  ///< labels of the camera paths; paths without a label are numbered from 0
  std::vector<std::string> missing;     ///< recordings partly or entirely absent from the map; printed in red
};

/// Throws std::runtime_error naming the option, its value and the allowed range, or an unsupported file extension.
void check(const PlanOptions& options, const std::filesystem::path& file);

/// A storey of the plan, with the deviation of its lines from the map.
struct ExportedStorey {
  double floor = 0;           ///< height along the world's -y, meters
  double floor_area = 0;      ///< m2 of observed floor
  std::vector<double> rooms;  ///< areas of the closed rooms, m2, largest first
  /// Area (m2) inside the building's outline without observed free space or surface between floor and cut, and its
  /// fraction of the floor area. Set with PlanOptions::coverage.
  double unobserved_area = 0, unobserved_share = 0;
  double walls = 0;  ///< length of the drawn surface cut, meters
  /// Distance between the surface cut and its lines, meters: mean, 95th percentile by length, and maximum.
  double mean_off = 0, p95_off = 0, max_off = 0;
};

/// Statistics of a drawn plan.
struct ExportedPlan {
  int scale = 0;
  std::string paper;                         ///< A4 to A0; empty: larger
  double width_mm = 0, height_mm = 0;        ///< page size
  std::vector<ExportedStorey> storeys;       ///< sorted by height, lowest first
  int loops = 0, loops_between = 0;          ///< drawn loop closures; the subset between two recordings
  std::vector<std::filesystem::path> files;  ///< written files
};

}  // namespace cairn
