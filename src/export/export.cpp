// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/export.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "export/export_run.hpp"
#include "export/texturer.hpp"
#include "export/write.hpp"

namespace cairn {

namespace fs = std::filesystem;

namespace {

constexpr double kTypicalRemainingRatio = 0.15;  // typical ratio

/// Approximate ratio of triangles left by simplification.
double remaining_ratio(const ExportRun& run) {
  const SimplifyOptions& o = run.options.simplify;
  if (o.triangles > 0) return std::min(1.0, static_cast<double>(run.ratio_of(o.triangles)));
  return o.max_error > 0 && o.ratio >= 1 ? kTypicalRemainingRatio : static_cast<double>(o.ratio);
}

/// Cost of all steps of the run.
double cost_of(const ExportRun& run) {
  const ExportOptions& options = run.options;
  const bool has_points = options.point_spacing > 0;
  double per_brick = ProgressCost::kMesh + ProgressCost::kClean + ProgressCost::kWrite;
  if (run.simplifies() && !has_points) per_brick += ProgressCost::kSimplify;
  if (options.texture.enabled) {
    // Each level of detail has a texture, with about a quarter of the cost of the level before.
    const double levels = is_tileset(run.file) || options.levels > 1 ? 1 / (1 - static_cast<double>(kLevelRatio)) : 1;
    per_brick += levels * (run.cost.charts + run.cost.texture);
  }
  return per_brick * static_cast<double>(run.input.bricks.size()) +
         (has_points ? ProgressCost::kPoint * run.expected_points() : 0);
}

}  // namespace

ExportReport export_surface(const ExportInput& input, const fs::path& file, const ExportOptions& options,
                            const ExportProgress& progress) {
  check(options, file);
  if (input.bricks.empty()) throw not_written(file, "the map is empty: no frame was fused into it");
  const bool has_texture = options.texture.enabled;
  ExportRun run{.input = input,
                .file = file,
                .options = options,
                .progress = progress,
                .cells = Cells(input.bricks, input.volume.brick_size(), is_tileset(file), options, input.block)};
  run.cost.charts = ProgressCost::kChartsBase + ProgressCost::kChartsFull * remaining_ratio(run);
  run.cost.texture +=
      ProgressCost::kKeyframe * static_cast<double>(input.keyframes.size()) / static_cast<double>(input.bricks.size());
  run.cost.total = cost_of(run);
  run.triangles_left = options.simplify.triangles;
  run.bricks_left = static_cast<double>(input.bricks.size());
  run.step(0, has_texture ? "comparing exposures" : "meshing");
  std::optional<Texturer> storage;
  Texturer* const texturer = has_texture ? &storage.emplace(run) : nullptr;
  if (is_tileset(file))
    write_tiles(run, texturer);
  else if (options.point_spacing > 0)
    write_points(run);
  else
    write_parts(run, texturer);
  run.end();
  return std::move(run.exported);
}

}  // namespace cairn
