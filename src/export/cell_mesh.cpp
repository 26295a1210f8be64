// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/cell_mesh.hpp"

#include <malloc.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "export/texturer.hpp"
#include "mesh/clean.hpp"
#include "mesh/simplify.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

constexpr float kMaxError = 2;  // voxels: maximum error for a ratio, doubled from level to level
constexpr std::uint8_t kNeverUnlocked = 255;

void select(std::vector<std::uint8_t>& values, const std::vector<std::uint32_t>& kept) {
  std::vector<std::uint8_t> taken;
  taken.reserve(kept.size());
  for (const std::uint32_t v : kept) taken.push_back(values[v]);
  values = std::move(taken);
}

/// First level at which two cells have the same parent.
std::uint8_t common_level(const Brick& a, const Brick& b) {
  for (std::uint8_t level = 0; level < 30; ++level)
    if (Cells::at_level(a, level) == Cells::at_level(b, level)) return level;
  return kNeverUnlocked;
}

/// Triangles of the cell itself, from the mesh of its surroundings.
CellMesh cut_out(Mesh mesh, const Cells& cells, const Cells::Key& cell) {
  CellMesh part;
  part.unlock_level.assign(mesh.positions.size(), 0);
  if (!cells.is_single()) {
    for (const auto& t : mesh.triangles) {
      const std::uint8_t level = common_level(cells.owner(mesh, t), Cells::brick(cell));
      for (const std::uint32_t v : t) part.unlock_level[v] = std::max(part.unlock_level[v], level);
    }
    std::erase_if(mesh.triangles, [&](const auto& t) { return !cells.is_own(mesh, t, cell); });
    select(part.unlock_level, drop_unused_vertices(mesh));
  }
  part.mesh = std::move(mesh);
  return part;
}

/// A mesh without colors has the volume's gray everywhere.
bool has_colors(const Mesh& mesh) {
  return std::any_of(mesh.colors.begin(), mesh.colors.end(), [](const auto& c) {
    return c != std::array<std::uint8_t, 4>{179, 179, 179, 255};
  });
}

}  // namespace

CellMesh make_cell_mesh(ExportRun& run, Texturer* texturer, const Cells::Key& cell) {
  const ExportInput& input = run.input;
  Mesh mesh = run.timed("mesh", [&] {
    const std::vector<Brick> bricks = run.cells.around(cell);
    if (input.load) {
      input.load(bricks);
      if (texturer != nullptr) texturer->discard_images();  // the views see another part of the map now
    }
    return input.polygonizer.polygonize(input.volume, bricks);
  });
  const auto bricks = static_cast<double>(run.cells.all().at(cell).size());
  run.step(ProgressCost::kMesh * bricks, "cleaning");
  CellMesh part = run.timed("clean", [&] {
    run.exported.full_triangles += static_cast<std::size_t>(std::count_if(
        mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& t) { return run.cells.is_own(mesh, t, cell); }));
    // A component across a border of cells is found in both cells, and counted once.
    const Cleaned cleaned =
        clean(mesh, run.options.clean, [&](const auto& t) { return run.cells.is_own(mesh, t, cell); });
    run.exported.components_removed += cleaned.components_removed;
    run.exported.holes_filled += cleaned.holes_filled;
    return cut_out(std::move(mesh), run.cells, cell);
  });
  part.bricks = bricks;
  part.mesh.weights.clear();
  if (input.load) malloc_trim(0);  // limits memory growth from part to part
  if (!has_colors(part.mesh)) part.mesh.colors.clear();
  if (texturer != nullptr) part.colors = std::make_shared<VoxelColors>(part.mesh, input.volume.options().voxel_size);
  run.step(ProgressCost::kClean * bricks, "simplifying");
  return part;
}

void simplify_cell_mesh(ExportRun& run, CellMesh& part, SimplifyOptions options, int unlocked_level, int level) {
  // Keeps more triangles than the ratio if its error would be larger.
  if (options.max_error <= 0 && options.ratio < 1)
    options.max_error = std::ldexp(kMaxError * run.input.volume.options().voxel_size, level);
  run.timed("simplify", [&] {
    std::vector<bool> locked(part.unlock_level.size(), false);
    for (std::size_t v = 0; v < locked.size(); ++v) locked[v] = part.unlock_level[v] > unlocked_level;
    const Simplified simplified = simplify(part.mesh, options, locked, !run.options.texture.enabled);
    select(part.unlock_level, simplified.kept);
    part.error += simplified.error;
  });
}

void simplify_finest(ExportRun& run, CellMesh& part) {
  SimplifyOptions options = run.options.simplify;
  if (options.triangles > 0) {
    // The share left over by a cell goes to the next cells.
    const double share = std::min(1.0, part.bricks / run.bricks_left);
    options.triangles = static_cast<std::size_t>(share * static_cast<double>(run.triangles_left));
    run.bricks_left -= part.bricks;
    if (options.triangles == 0) {
      part.mesh = {};
      part.unlock_level.clear();
      return;
    }
  }
  simplify_cell_mesh(run, part, options, 0, 0);
  if (options.triangles > 0) run.triangles_left -= part.mesh.triangles.size();
  run.add_error(part.error);
  if (run.simplifies())
    run.step(ProgressCost::kSimplify * part.bricks, run.options.texture.enabled ? "charting" : "writing");
}

CellMesh merge_cell_meshes(std::vector<CellMesh> parts) {
  std::vector<Mesh> meshes;
  CellMesh all;
  for (CellMesh& part : parts) {
    meshes.push_back(std::move(part.mesh));
    all.unlock_level.insert(all.unlock_level.end(), part.unlock_level.begin(), part.unlock_level.end());
    all.error = std::max(all.error, part.error);
    all.bricks += static_cast<double>(kLevelRatio) * part.bricks;
  }
  all.mesh = joined(meshes);
  const std::vector<std::uint32_t> vertex_id = weld(all.mesh);
  for (std::size_t v = 0; v < vertex_id.size(); ++v)
    all.unlock_level[vertex_id[v]] = std::max(all.unlock_level[vertex_id[v]], all.unlock_level[v]);
  for (auto& t : all.mesh.triangles)
    for (std::uint32_t& v : t) v = vertex_id[v];
  select(all.unlock_level, drop_unused_vertices(all.mesh));
  return all;
}

}  // namespace cairn
