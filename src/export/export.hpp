// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// From the volume to a file: cell by cell mesh, clean, simplify, texture, write.
#pragma once
#include <functional>
#include <optional>
#include <span>

#include "cairn/export.hpp"
#include "cairn/rig.hpp"
#include "cairn/surface_sigma.hpp"
#include "cairn/trajectory.hpp"
#include "cairn/upright.hpp"
#include "texture/views.hpp"
#include "volume/polygonize.hpp"

namespace cairn {

/// What there is to export.
struct ExportInput {
  std::vector<Brick> bricks;                         // of the whole map, sorted
  Volume& volume;                                    // of the whole map, or of what `load` has brought
  std::function<void(std::span<const Brick>)> load;  // brings bricks in place of those before; none: all are there
  Polygonizer& polygonizer;
  Rig rig;
  SurfaceOptions surface;
  std::vector<TextureKeyframe> keyframes;
  TextureViews::GetImage get_image;
  std::vector<Trajectory> paths;  // in the world that is written
  Upright upright;                // how all else is turned to be there
  const SurfaceSigma& sigma;      // empty: not known
  std::optional<Brick> block;     // of a tileset: that one alone, see Cells; `bricks` are those in and around it
};

/// By the extension of `file`, see write_mesh; also tileset.json, 3D Tiles 1.1 with levels of detail. Throws
/// std::runtime_error with what to do; nothing is half written.
Exported export_surface(const ExportInput& input, const std::filesystem::path& file, const ExportOptions& options,
                        const ExportProgress& progress);

}  // namespace cairn
