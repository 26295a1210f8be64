// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A file read at once.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <vector>

namespace cairn {

/// Bytes of the largest file that is read at once, and what a mesh may have.
constexpr std::size_t kMostWhole = std::size_t{512} << 20, kAnySize = std::numeric_limits<std::size_t>::max();

/// All bytes of a file of at most `most`. Throws std::runtime_error that says why not, without the file's name: a
/// device or a pipe, which may never end, is no file.
[[nodiscard]] std::vector<std::uint8_t> read_whole(const std::filesystem::path& file, std::size_t most = kMostWhole);

}  // namespace cairn
