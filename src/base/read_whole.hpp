// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A file read at once.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

namespace cairn {

/// All bytes of a file. Throws std::runtime_error that says why not, without the file's name: a device or a pipe, which
/// may never end, is no file.
[[nodiscard]] std::vector<std::uint8_t> read_whole(const std::filesystem::path& file);

}  // namespace cairn
