// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Words of command lines that are shown to people, who copy them.
#pragma once
#include <filesystem>
#include <string>

namespace cairn {

/// A word as a shell reads it.
[[nodiscard]] std::string quoted(const std::string& word);
[[nodiscard]] inline std::string quoted(const char* word) { return quoted(std::string(word)); }
/// A path so, which is never taken for an option.
[[nodiscard]] std::string quoted(const std::filesystem::path& path);

}  // namespace cairn
