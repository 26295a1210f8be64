// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Floor plans from a volume, part by part, so that a map may be larger than the memory.
#pragma once
#include <vector>

#include "cairn/mapping/export.hpp"
#include "cairn/mapping/floor_plan.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "export/map_chunks.hpp"
#include "floor_plan/layout.hpp"

namespace cairn {

/// Input of a floor plan.
struct PlanInput {
  const MapChunks& map;
  std::vector<Trajectory> paths;  // of the recordings, in the written world
  std::vector<plan::LoopLine> loops;
};

/// Writes by the extension of `file`: .pdf with a page for each storey, or .svg or .dxf with a file for each of
/// several storeys: X-1.svg, X-2.svg, the lowest first. Throws std::runtime_error with the remedy; each file is atomic.
ExportedPlan export_floor_plan(const PlanInput& input, const std::filesystem::path& file, const PlanOptions& options,
                               const ExportProgress& progress);

}  // namespace cairn
