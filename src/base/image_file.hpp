// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Whole images from the bytes of PNG and JPEG files, and such bytes.
#pragma once
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <span>
#include <vector>

#include "cairn/camera.hpp"

namespace cairn {

/// A whole PNG or JPEG; `flags` as of cv::imdecode. Throws std::runtime_error that says why not: cut off (the decoders
/// fill the rest with grey and only print a warning), damaged, or larger than its bytes can be.
[[nodiscard]] cv::Mat decode_image(std::span<const std::uint8_t> bytes, int flags);

/// Metres as whole units. `none`: where nothing was measured, and where more units than 16 bits hold would stand.
[[nodiscard]] std::vector<std::uint16_t> depth_units(std::span<const float> depth, double units_per_metre,
                                                     std::uint16_t none = 0);
/// The same by pixel of the camera as the bytes of a PNG of 16 bits.
[[nodiscard]] std::vector<std::uint8_t> encode_depth(std::span<const float> depth, const Camera& camera,
                                                     double units_per_metre, std::uint16_t none = 0);

/// The bytes of a PNG or JPEG, by its extension. `colour`: bytes R, G, B, 255 by pixel of the camera.
[[nodiscard]] std::vector<std::uint8_t> encode_colour(std::span<const std::uint32_t> colour, const Camera& camera,
                                                      const char* extension);

}  // namespace cairn
