// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <stdexcept>

namespace cairn {

/// What Map::export_mesh throws where a texture was asked for and the map has no keyframes or these have no colour: the
/// same without TextureOptions::enabled gives the voxels' colours.
struct NoTexture : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace cairn
