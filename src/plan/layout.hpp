// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// From storeys in metres to pages in millimetres.
#pragma once
#include <string>
#include <vector>

#include "cairn/floor_plan.hpp"
#include "cairn/trajectory.hpp"
#include "plan/sheet.hpp"
#include "plan/storey_plan.hpp"

namespace cairn::plan {

/// Two keyframes that see the same, where they lie in the world.
struct LoopLine {
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();  // metres
  bool is_between = false;                                                       // two recordings
};

struct Pages {
  std::vector<Sheet> sheets;  // one a storey; the same place is at the same place of each
  int scale = 0;
  std::string paper;                 // empty: larger than A0
  int loops = 0, loops_between = 0;  // that are drawn: all, and those between two recordings
};

/// Storeys on the smallest paper that they fit on, most walls along its edges.
/// `paths`: by recording.
[[nodiscard]] Pages laid_out(const std::vector<StoreyPlan>& storeys, const std::vector<Trajectory>& paths,
                             const std::vector<LoopLine>& loops, const PlanOptions& options);

}  // namespace cairn::plan
