// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The files that parts become: one of points, one of all parts for each level of detail, or one of each tile.
#pragma once
#include "export/part.hpp"

namespace cairn {

/// Points of the surface instead of triangles.
void write_points(ExportRun& run);
// `texturer`: null without a texture.
void write_parts(ExportRun& run, Texturer* texturer);
void write_tiles(ExportRun& run, Texturer* texturer);

}  // namespace cairn
