// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Encoding of frames as PNG and JPEG files in memory.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// Encodes depth as a 16-bit PNG of the camera's size, in the same units.
[[nodiscard]] std::vector<std::uint8_t> encode_depth(std::span<const float> depth, const Camera& camera,
                                                     double units_per_meter, std::uint16_t none = 0);

/// Encodes a PNG or JPEG, selected by extension. `color`: bytes R, G, B, 255 per pixel of the camera.
[[nodiscard]] std::vector<std::uint8_t> encode_color(std::span<const std::uint32_t> color, const Camera& camera,
                                                     const char* extension);

}  // namespace cairn
