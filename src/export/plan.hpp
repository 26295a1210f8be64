// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// From the volume to floor plans: part by part, so that a map may be larger than the memory.
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "cairn/export.hpp"
#include "cairn/floor_plan.hpp"
#include "cairn/trajectory.hpp"
#include "cairn/upright.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// What there is to draw.
struct PlanInput {
  std::vector<Brick> bricks;                         // of the whole map, sorted
  Volume& volume;                                    // of the whole map, or of what `load` has brought
  std::function<void(std::span<const Brick>)> load;  // brings bricks in place of those before; none: all are there
  Polygonizer& polygonizer;
  const BrickTree& free;          // what was seen to be free
  std::vector<Trajectory> paths;  // in the world that is written
  Upright upright;                // how all else is turned to be there
};

/// By the extension of `file`: .pdf with a page for each storey, or .svg, of which several storeys get a file each:
/// X-1.svg, X-2.svg, the lowest first. Throws std::runtime_error with what to do; each file whole or not at all.
ExportedPlan export_floor_plan(const PlanInput& input, const std::filesystem::path& file, const PlanOptions& options,
                               const ExportProgress& progress);

}  // namespace cairn
