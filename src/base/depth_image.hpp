// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth images as files hold them: PNG, TIFF, NumPy's NPY and PGM.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>

#include "base/image_file.hpp"

namespace cairn {

/// A whole image by what its first bytes say: CV_16UC1 or CV_32FC1 in the file's own unit, also of three equal
/// channels, and what decode_image gives for a PNG or JPEG that is no depth image. Floats are as they are stored, NaN
/// and infinity, too. Throws std::runtime_error that says why not and what to do: cut off, damaged, of another kind of
/// number, beyond `bound`, or larger than its bytes can be.
[[nodiscard]] cv::Mat decode_depth(std::span<const std::uint8_t> bytes, const ImageBound& bound = {});

[[nodiscard]] bool is_tiff(std::span<const std::uint8_t> bytes);
/// Whether a TIFF has the numbers of depth rather than 8 bits of color; false for a damaged one.
[[nodiscard]] bool is_depth_tiff(std::span<const std::uint8_t> bytes);
/// CV_8UC4, R, G, B and 255, of a TIFF of color or grey with 8 bits. Throws as decode_depth.
[[nodiscard]] cv::Mat decode_color_tiff(std::span<const std::uint8_t> bytes, const ImageBound& bound = {});

}  // namespace cairn
