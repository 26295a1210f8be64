// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Export of a volume to a file: for each cell mesh, clean, simplify, texture, write.
#pragma once
#include <functional>
#include <optional>
#include <span>

#include "cairn/mapping/export.hpp"
#include "cairn/mapping/gravity_alignment.hpp"
#include "cairn/mapping/rig.hpp"
#include "cairn/mapping/surface_sigma.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "texture/views.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// Input of an export.
struct ExportInput {
  std::vector<Brick> bricks;                         // of the entire map, sorted
  Volume& volume;                                    // of the entire map, or of the bricks loaded last
  std::function<void(std::span<const Brick>)> load;  // loads bricks in place of the previous ones; empty: all are
                                                     // loaded
  Polygonizer& polygonizer;
  Rig rig;
  SurfaceOptions surface;
  std::vector<TextureKeyframe> keyframes;
  TextureViews::GetImage get_image;
  std::vector<Trajectory> paths;  // in the written world
  GravityAlignment upright;       // rotation into the written world
  const SurfaceSigma& sigma;      // empty: unknown
  std::optional<Brick> block;     // of a tileset: exports this block only, see Cells; `bricks` are in and around it
};

/// Writes by the extension of `file`, see write_mesh; also tileset.json, 3D Tiles 1.1 with levels of detail. Throws
/// std::runtime_error with the remedy; leaves no partial file.
ExportReport export_surface(const ExportInput& input, const std::filesystem::path& file, const ExportOptions& options,
                            const ExportProgress& progress);

}  // namespace cairn
