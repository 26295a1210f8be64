// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Surface of a cell during export.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "export/export_run.hpp"
#include "texture/voxel_colors.hpp"

namespace cairn {

class Texturer;

constexpr float kLevelRatio = 0.25f;  // of the triangles, from each level of detail to the next

/// Vertices shared with neighboring cells stay fixed until both cells are in the same mesh.
struct CellMesh {
  Mesh mesh;
  std::vector<std::uint8_t> unlock_level;     // by vertex: first level with all of its triangles in the same mesh
  float error = 0;                            // meters
  double bricks = 0;                          // cost in bricks
  std::shared_ptr<const VoxelColors> colors;  // of the surface before simplification, for textures
};

/// Clean surface of a cell, not yet simplified. `texturer`: null without a texture.
[[nodiscard]] CellMesh make_cell_mesh(ExportRun& run, Texturer* texturer, const Cells::Key& cell);
/// `unlocked_level`: level with all cells in the same mesh; `level` of detail.
void simplify_cell_mesh(ExportRun& run, CellMesh& part, SimplifyOptions options, int unlocked_level, int level);
/// Simplifies the finest level by ExportOptions::simplify, with the part's share of the triangles.
void simplify_finest(ExportRun& run, CellMesh& part);
/// Merges parts along the vertices shared at their borders.
[[nodiscard]] CellMesh merge_cell_meshes(std::vector<CellMesh> parts);

}  // namespace cairn
