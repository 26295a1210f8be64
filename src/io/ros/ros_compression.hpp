// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Chunk compression of ROS recordings. All calls of bzip2, LZ4 and Zstandard are in ros_compression.cpp.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace cairn {

/// Decompresses `packed`. `kind`: bz2, lz4 (frame format) or zstd. Throws std::runtime_error, without the file name,
/// for another kind, for damaged or truncated data, and if the size differs from `expected_size` or exceeds 256 MiB.
/// `buffer`: buffer to reuse.
[[nodiscard]] std::vector<std::uint8_t> unpacked(std::string_view kind, std::span<const std::uint8_t> packed,
                                                 std::optional<std::uint64_t> expected_size,
                                                 std::vector<std::uint8_t> buffer = {});

/// Compresses bytes to a Zstandard frame; optimized for speed, not size.
[[nodiscard]] std::vector<std::uint8_t> compress_zstd(std::span<const std::uint8_t> bytes);

}  // namespace cairn
