// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Conversion of storeys in meters to pages in millimeters.
#pragma once
#include <string>
#include <vector>

#include "cairn/mapping/floor_plan.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "floor_plan/sheet.hpp"
#include "floor_plan/storey_plan.hpp"

namespace cairn::plan {

/// Loop between two keyframes, by their positions in the world.
struct LoopLine {
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();  // meters
  bool is_between = false;                                                       // two recordings
};

struct Pages {
  std::vector<Sheet> sheets;  // one per storey, all with the same placement
  int scale = 0;
  std::string paper;                 // empty: larger than A0
  int loops = 0, loops_between = 0;  // drawn loops: all, and between two recordings
};

/// Fits storeys on the smallest paper, with most walls along its edges.
/// `paths`: by recording.
[[nodiscard]] Pages laid_out(const std::vector<StoreyPlan>& storeys, const std::vector<Trajectory>& paths,
                             const std::vector<LoopLine>& loops, const PlanOptions& options);

}  // namespace cairn::plan
