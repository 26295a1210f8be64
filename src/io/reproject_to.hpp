// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings of several cameras fused into a map with a single camera.
#pragma once
#include <memory>

#include "cairn/io/source.hpp"

namespace cairn {

/// Resamples the frames into the cameras of another rig at the same pose: each target pixel shows the source image
/// along its ray, and has no depth outside the source image. Depth is first corrected and range-filtered by the
/// source's own model; the target rig's sensor model then weights it. Throws std::runtime_error with the reason if
/// images alone are not enough: different shutter readouts, or color cameras at different positions.
[[nodiscard]] std::unique_ptr<Source> reproject_to(std::unique_ptr<Source> source, const Rig& rig);

}  // namespace cairn
