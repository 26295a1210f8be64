// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>

namespace cairn {

/// Writes a PNG atomically. `rgb`: bytes R, G, B per pixel, row-major from the top. Throws std::runtime_error if the
/// file cannot be written.
void write_png(const std::filesystem::path& file, int width, int height, std::span<const std::uint8_t> rgb);

}  // namespace cairn
