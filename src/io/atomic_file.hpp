// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string_view>

namespace cairn {

/// Writes a file whole or not at all: `write` fills a temporary one beside it, which is then renamed. Throws
/// std::runtime_error with the path and what to do; the temporary file is gone then.
void write_whole(const std::filesystem::path& file,
                 const std::function<void(const std::filesystem::path& temporary)>& write);
/// The same for what is in memory; a full disk is told.
void write_whole(const std::filesystem::path& file, std::span<const std::uint8_t> bytes);
void write_whole(const std::filesystem::path& file, std::string_view text);

}  // namespace cairn
