// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/frame.hpp"
#include "place/features.hpp"
#include "surface/surface.hpp"

namespace cairn {

/// Corners of a frame, in the depth camera's view: where the colour camera looks from beside, its image is taken as the
/// device has brought it to depth.
[[nodiscard]] Features features_of(const Surface& live, const Rig& rig, gpu::Device& device);

}  // namespace cairn
