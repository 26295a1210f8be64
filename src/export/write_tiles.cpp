// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <optional>
#include <utility>

#include "export/texturer.hpp"
#include "export/tiles_folder.hpp"
#include "export/write.hpp"
#include "mesh/tiles.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct TilePart {
  Tile tile;
  CellMesh part;
};

CellMesh make_leaf(ExportRun& run, Texturer* texturer, const Cells::Key& cell) {
  CellMesh part = make_cell_mesh(run, texturer, cell);
  simplify_finest(run, part);
  return part;
}

void write_content(ExportRun& run, const fs::path& folder, const std::string& name, const Mesh& mesh, int level) {
  run.timed("write", [&] {
    GltfWriter writer(run.gltf_options());
    const auto added = writer.add(name.substr(0, name.find('.')), mesh);
    if (level == 0) run.add(added);
    writer.write(folder / name);
  });
}

/// Makes tiles from the leaves up; each stays in memory until its parent is made. Returns nullopt without a surface.
std::optional<TilePart> make_tile(ExportRun& run, Texturer* texturer, const fs::path& folder, const Cells::Key& cell,
                                  int level) {
  Tile tile;
  CellMesh part;
  if (level == 0) {
    if (!run.cells.all().contains(cell)) return std::nullopt;
    part = make_leaf(run, texturer, cell);
  } else {
    std::vector<CellMesh> children;
    for (int c = 0; c < 8; ++c) {
      const Brick child_cell = 2 * Cells::brick(cell) + Brick(c & 1, c >> 1 & 1, c >> 2);
      if (auto child = make_tile(run, texturer, folder, Cells::key(child_cell), level - 1)) {
        tile.children.push_back(std::move(child->tile));
        children.push_back(std::move(child->part));
      }
    }
    if (children.empty()) return std::nullopt;
    part = merge_cell_meshes(std::move(children));
    simplify_cell_mesh(run, part, {.ratio = kLevelRatio}, level, level);
    run.add_error(part.error);
    for (const Tile& child : tile.children) tile.box.extend(child.box);
  }
  if (part.mesh.triangles.empty()) return std::nullopt;
  const Eigen::Isometry3d turn(run.input.upright.world_from_tracked);
  for (const auto& p : part.mesh.positions) tile.box.extend((turn * p.cast<double>()).cast<float>().eval());
  tile.error = part.error;
  tile.content = fmt::format("{}_{}_{}_{}.glb", level, cell[0], cell[1], cell[2]);
  ++run.exported.tiles;
  write_content(run, folder, tile.content,
                run.as_written(texturer != nullptr ? texturer->texture(part.mesh, part, level) : part.mesh), level);
  if (level == 0) run.step(ProgressCost::kWrite * part.bricks, "meshing");
  return TilePart{std::move(tile), std::move(part)};
}

/// Number of levels up to a single root cell.
int levels_above(const Cells& cells) {
  int top = 0;
  for (const auto& [cell, bricks] : cells.all())
    while (Cells::at_level(Cells::brick(cell), top) != Brick::Zero()) ++top;
  return top;
}

}  // namespace

void write_tiles(ExportRun& run, Texturer* texturer) {
  const int top = run.input.block ? Cells::kBlockLevels : levels_above(run.cells);
  TilesFolder tiles(run.file);
  auto root = make_tile(run, texturer, tiles.part(), {0, 0, 0}, top);
  if (!root && run.input.block) root.emplace();  // all surface was too small to keep
  run.refuse_empty(root.has_value());
  run.timed("write", [&] {
    put_into(root->tile, tiles.finish());
    write_tileset(run.file, root->tile, run.options.geo);
    tiles.keep();
  });
  run.exported.files = tiles.files();
  run.exported.files.insert(run.exported.files.begin(), run.file);
}

}  // namespace cairn
