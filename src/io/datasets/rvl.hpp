// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn {

/// Decodes a depth image compressed by RVL ("Fast Lossless Depth Image Compression", Wilson, ISS 2017): alternating
/// counts of zero and nonzero pixels, and the difference of each nonzero pixel from the previous, in groups of three
/// bits. Throws std::runtime_error for damaged or truncated data.
[[nodiscard]] std::vector<std::uint16_t> decode_rvl(std::span<const std::uint8_t> packed, std::size_t pixels);

}  // namespace cairn
