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

struct Pages {
  std::vector<Sheet> sheets;  // one a storey; the same place is at the same place of each
  int scale = 0;
  std::string paper;  // empty: larger than A0
};

/// Storeys on the smallest paper that they fit on, most walls along its edges.
[[nodiscard]] Pages laid_out(const std::vector<StoreyPlan>& storeys, const std::vector<Trajectory>& paths,
                             const PlanOptions& options);

}  // namespace cairn::plan
