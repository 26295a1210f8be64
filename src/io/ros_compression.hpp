// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How recordings of ROS pack their chunks; the only door to bzip2, LZ4 and Zstandard.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace cairn {

/// All that `packed` holds. `kind`: bz2, lz4 (its frame format) or zstd. Throws std::runtime_error, without the file's
/// name, for another kind, for bytes that are damaged or cut off, and where they hold another number of bytes than
/// `promised` or more than 256 MiB. `memory`: bytes that nobody needs, to be overwritten.
[[nodiscard]] std::vector<std::uint8_t> unpacked(std::string_view kind, std::span<const std::uint8_t> packed,
                                                 std::optional<std::uint64_t> promised,
                                                 std::vector<std::uint8_t> memory = {});

/// A frame of Zstandard that holds these bytes; quick rather than small.
[[nodiscard]] std::vector<std::uint8_t> packed_by_zstd(std::span<const std::uint8_t> bytes);

}  // namespace cairn
