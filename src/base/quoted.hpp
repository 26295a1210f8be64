// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Quoting of command-line words in messages, so that users can copy them.
#pragma once
#include <filesystem>
#include <string>

namespace cairn {

/// Quotes a word for a shell.
[[nodiscard]] std::string quoted(const std::string& word);
[[nodiscard]] inline std::string quoted(const char* word) { return quoted(std::string(word)); }
/// Quotes a path so that it cannot be parsed as an option.
[[nodiscard]] std::string quoted(const std::filesystem::path& path);

}  // namespace cairn
