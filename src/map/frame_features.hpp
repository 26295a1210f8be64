// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include "cairn/frame.hpp"
#include "place/features.hpp"
#include "surface/surface.hpp"

namespace cairn {

/// Features of a frame in the depth camera's view. With a separate color camera, the color image is the one registered
/// to depth on the device.
[[nodiscard]] Features features_of(const Surface& live, const Rig& rig, gpu::Device& device);

}  // namespace cairn
