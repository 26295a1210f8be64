// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// gzip files (RFC 1952) in memory.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

/// Compresses bytes, deterministically.
[[nodiscard]] std::string gzip(std::string_view bytes);

/// CRC-32 of bytes (ISO 3309), continued from the sum of the bytes before them.
[[nodiscard]] std::uint32_t crc32_of(std::string_view bytes, std::uint32_t before = 0);

/// First `max_size` bytes of a file's content; fewer if the content or the file ends before. Memory grows with the
/// bytes found. Throws std::runtime_error for damaged files.
[[nodiscard]] std::vector<std::uint8_t> gunzip(std::span<const std::uint8_t> file, std::size_t max_size);

}  // namespace cairn
