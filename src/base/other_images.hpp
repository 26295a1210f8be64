// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color images in formats that camera programs do not write by default: BMP, WebP and TIFF.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>

#include "base/image_file.hpp"

namespace cairn {

/// Decodes a BMP, WebP or TIFF, detected by its first bytes, as CV_8UC4: R, G, B and alpha (255 if opaque). Returns
/// nullopt for other formats. Throws std::runtime_error with the reason: truncated, damaged, beyond `bound`. Checks the
/// size before allocating pixels.
[[nodiscard]] std::optional<cv::Mat> decode_other_image(std::span<const std::uint8_t> bytes,
                                                        const ImageBound& bound = {});

}  // namespace cairn
