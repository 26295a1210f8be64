// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Command lines that a user can copy.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::apps {

/// The command line that goes on with what `words` began, the program's name before them: with --resume, and with the
/// folder that was written to in the place of the one that was asked for.
[[nodiscard]] std::string resuming(std::vector<std::string> words, const std::filesystem::path& asked,
                                   const std::filesystem::path& written);
/// The words that this program was started with.
[[nodiscard]] std::vector<std::string> own_words();

}  // namespace cairn::apps
