// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth in OpenEXR files; the only door to OpenEXR.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string_view>

namespace cairn {

inline constexpr std::string_view kExrMagic("\x76\x2f\x31\x01", 4);

/// Depth of an OpenEXR file as CV_32FC1: the channel Z, Y or R, else a single one, of halves, floats or whole numbers.
/// Throws std::runtime_error, without the file's name, for pixels beyond `most_pixels` a side, for a picture (channels
/// R, G and B that differ), and for a file that is damaged or cut off.
[[nodiscard]] cv::Mat decode_exr(std::span<const std::uint8_t> bytes, std::uint32_t most_pixels);

}  // namespace cairn
