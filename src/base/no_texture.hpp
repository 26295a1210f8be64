// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <stdexcept>

namespace cairn {

/// Error thrown by Map::export_mesh if a texture was requested but the map has no keyframes, or keyframes without
/// color. Without TextureOptions::enabled, the export uses voxel colors.
struct NoTexture : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace cairn
