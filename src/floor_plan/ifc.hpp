// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <vector>

#include "floor_plan/storey_plan.hpp"

namespace cairn::plan {

/// Building model: IFC 4 (ISO 16739-1), as STEP text (ISO 10303-21), in meters, z up, x and y as in the plan. A storey
/// has walls with openings and doors, slabs of the observed floor, and closed rooms as spaces with their areas. The
/// same storeys give the same bytes. `title`: of the project, UTF-8.
[[nodiscard]] std::string ifc_of(const std::vector<StoreyPlan>& storeys, const std::string& title);

}  // namespace cairn::plan
