// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Decoding of depth images: PNG, TIFF, NumPy's NPY, OpenEXR and PGM.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>

#include "base/image_file.hpp"

namespace cairn {

/// Decodes a depth image, detected by its first bytes, as CV_16UC1 or CV_32FC1 in the file's own unit. Accepts three
/// equal channels. For a PNG or JPEG without depth it returns the result of decode_image. Floats are returned as
/// stored, including NaN and infinity. Throws std::runtime_error with the reason and the remedy: truncated, damaged,
/// unsupported number type, beyond `bound`, or a declared size impossible for the number of bytes.
[[nodiscard]] cv::Mat decode_depth(std::span<const std::uint8_t> bytes, const ImageBound& bound = {});

[[nodiscard]] bool is_tiff(std::span<const std::uint8_t> bytes);
/// True if a TIFF stores depth values rather than 8-bit color; false for a damaged file.
[[nodiscard]] bool is_depth_tiff(std::span<const std::uint8_t> bytes);
/// Decodes an 8-bit color or gray TIFF as CV_8UC4: R, G, B and alpha (255 if absent). Throws as decode_depth.
[[nodiscard]] cv::Mat decode_color_tiff(std::span<const std::uint8_t> bytes, const ImageBound& bound = {});

}  // namespace cairn
