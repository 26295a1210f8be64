// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>

#include "cairn/io/source.hpp"

namespace cairn {

/// Estimates the extrinsics and focal length of the color camera from depth discontinuities, most of which are color
/// edges too (Levinson & Thrun 2013 align a laser to a camera in the same manner). Searches rotation, position and
/// focal length around source.rig(): 4 degrees, 12 cm and a fifth of the length to each side. Principal point and lens
/// stay fixed.
///
/// Reads `frames` frames, spread over the entire source, and skips the frames between. Returns nullopt if the given rig
/// fits about as well, or if too few edges are visible. Deterministic for the same frames.
[[nodiscard]] std::optional<Rig> find_color_camera(Source& source, int frames = 40);

}  // namespace cairn
