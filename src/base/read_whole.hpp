// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reading of an entire file.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <vector>

namespace cairn {

/// Maximum size in bytes of a file read at once; unlimited size, for meshes.
constexpr std::size_t kMaxFileSize = std::size_t{512} << 20, kAnySize = std::numeric_limits<std::size_t>::max();

/// All bytes of a file of at most `max_size` bytes. Throws std::runtime_error with the reason, without the file's name.
/// Rejects devices and pipes, because they may be endless.
[[nodiscard]] std::vector<std::uint8_t> read_whole(const std::filesystem::path& file,
                                                   std::size_t max_size = kMaxFileSize);

}  // namespace cairn
