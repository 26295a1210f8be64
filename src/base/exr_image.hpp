// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth in OpenEXR files; the only user of OpenEXR.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string_view>

namespace cairn {

inline constexpr std::string_view kExrMagic("\x76\x2f\x31\x01", 4);

/// Decodes the depth of an OpenEXR file as CV_32FC1: channel Z, Y or R, else the only channel, of type half, float or
/// uint. Throws std::runtime_error, without the file's name, for more than `max_side` pixels per side, for a color
/// picture (channels R, G and B differ), and for a damaged or truncated file.
[[nodiscard]] cv::Mat decode_exr(std::span<const std::uint8_t> bytes, std::uint32_t max_side);

}  // namespace cairn
