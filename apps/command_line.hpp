// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Command lines for users to copy.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::apps {

/// Returns the command line that resumes the command `words` (program name first): with --resume, and with the written
/// folder in place of the requested folder.
[[nodiscard]] std::string resuming(std::vector<std::string> words, const std::filesystem::path& asked,
                                   const std::filesystem::path& written);
/// Returns the words this program was started with.
[[nodiscard]] std::vector<std::string> own_words();

}  // namespace cairn::apps
