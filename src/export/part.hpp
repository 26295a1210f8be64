// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Surface of a cell during export.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "export/export_run.hpp"
#include "texture/voxel_colours.hpp"

namespace cairn {

class Texturer;

constexpr float kLevelRatio = 0.25f;  // of the triangles, from each level of detail to the next

/// Vertices shared with neighboring cells stay fixed until both cells are in the same mesh.
struct Part {
  Mesh mesh;
  std::vector<std::uint8_t> free_from;          // by vertex: first level with all of its triangles in the same mesh
  float error = 0;                              // meters
  double bricks = 0;                            // cost in bricks
  std::shared_ptr<const VoxelColours> colours;  // of the surface before simplification, for textures
};

/// Clean surface of a cell, not yet simplified. `texturer`: null without a texture.
[[nodiscard]] Part make_part(ExportRun& run, Texturer* texturer, const Cells::Key& cell);
/// `freed`: level with all cells in the same mesh; `level` of detail.
void simplify_part(ExportRun& run, Part& part, SimplifyOptions options, int freed, int level);
/// Simplifies the finest level by ExportOptions::simplify, with the part's share of the triangles.
void simplify_finest(ExportRun& run, Part& part);
/// Merges parts along the vertices shared at their borders.
[[nodiscard]] Part join_parts(std::vector<Part> parts);

}  // namespace cairn
