// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Whole images from the bytes of PNG and JPEG files.
#pragma once
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <span>

namespace cairn {

/// A whole PNG or JPEG; `flags` as of cv::imdecode. Throws std::runtime_error that says why not: cut off (the decoders
/// fill the rest with grey and only print a warning), damaged, or larger than its bytes can be.
[[nodiscard]] cv::Mat decode_image(std::span<const std::uint8_t> bytes, int flags);

}  // namespace cairn
