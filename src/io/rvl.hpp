// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cairn {

/// An image of depth as "Fast Lossless Depth Image Compression" packs it (Wilson, ISS 2017): by turns how many pixels
/// are 0, how many are not, and what each of these has more than the one before, in pieces of three bits. Throws
/// std::runtime_error for bytes that are damaged or cut off.
[[nodiscard]] std::vector<std::uint16_t> unpacked_rvl(std::span<const std::uint8_t> packed, std::size_t pixels);

}  // namespace cairn
