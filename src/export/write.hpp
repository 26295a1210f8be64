// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Output files of parts: points, all parts for each level of detail, or tiles.
#pragma once
#include "export/cell_mesh.hpp"

namespace cairn {

/// Writes points of the surface instead of triangles.
void write_points(ExportRun& run);
// `texturer`: null without a texture.
void write_parts(ExportRun& run, Texturer* texturer);
void write_tiles(ExportRun& run, Texturer* texturer);

}  // namespace cairn
