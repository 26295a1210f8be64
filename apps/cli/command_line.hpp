// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Command lines for users to copy.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::apps {

/// Returns the command line that resumes the command `arguments` (program name first): with --resume, and with the
/// written folder in place of the requested folder.
[[nodiscard]] std::string resume_command(std::vector<std::string> arguments, const std::filesystem::path& requested,
                                         const std::filesystem::path& written);
/// Returns the arguments this program was started with.
[[nodiscard]] std::vector<std::string> own_arguments();

}  // namespace cairn::apps
