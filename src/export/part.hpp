// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A cell's surface on its way into a file.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "export/export_run.hpp"
#include "texture/voxel_colours.hpp"

namespace cairn {

class Texturer;

constexpr float kLevelRatio = 0.25f;  // of the triangles, from one level of detail to the next

/// Vertices that neighbouring cells share stay until both are in one mesh.
struct Part {
  Mesh mesh;
  std::vector<std::uint8_t> free_from;  // by vertex: the level from which on all of its triangles are in one mesh
  float error = 0;                      // metres
  double bricks = 0;                    // that it is as much work as
  std::shared_ptr<const VoxelColours> colours;  // of the surface before it was simplified, for textures
};

/// A cell's surface, clean, not yet simpler. `texturer`: null without a texture.
[[nodiscard]] Part make_part(ExportRun& run, Texturer* texturer, const Cells::Key& cell);
/// `freed`: what is in one mesh by now; `level` of detail.
void simplify_part(ExportRun& run, Part& part, SimplifyOptions options, int freed, int level);
/// The finest level, as ExportOptions::simplify says; of its triangles the part gets its share.
void simplify_finest(ExportRun& run, Part& part);
/// Parts that share vertices at their borders become one.
[[nodiscard]] Part join_parts(std::vector<Part> parts);

}  // namespace cairn
