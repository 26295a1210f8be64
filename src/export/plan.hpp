// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// From the volume to floor plans: part by part, so that a map may be larger than the memory.
#pragma once
#include <vector>

#include "cairn/export.hpp"
#include "cairn/floor_plan.hpp"
#include "cairn/trajectory.hpp"
#include "export/map_parts.hpp"
#include "plan/layout.hpp"

namespace cairn {

/// What there is to draw.
struct PlanInput {
  const MapParts& map;
  std::vector<Trajectory> paths;  // of the recordings, in the world that is written
  std::vector<plan::LoopLine> loops;
};

/// By the extension of `file`: .pdf with a page for each storey, or .svg, of which several storeys get a file each:
/// X-1.svg, X-2.svg, the lowest first. Throws std::runtime_error with what to do; each file whole or not at all.
ExportedPlan export_floor_plan(const PlanInput& input, const std::filesystem::path& file, const PlanOptions& options,
                               const ExportProgress& progress);

}  // namespace cairn
