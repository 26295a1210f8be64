// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color images of kinds that no camera program writes by default: BMP, WebP and TIFF.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>

#include "base/image_file.hpp"

namespace cairn {

/// CV_8UC4, R, G, B and 255 where there is no transparency, of a whole BMP, WebP or TIFF by its first bytes; nothing
/// for other kinds. Throws std::runtime_error that says why not: cut off, damaged, beyond `bound`. The size is checked
/// before any pixel has memory.
[[nodiscard]] std::optional<cv::Mat> decode_other_image(std::span<const std::uint8_t> bytes,
                                                        const ImageBound& bound = {});

}  // namespace cairn
