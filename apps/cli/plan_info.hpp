// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Progress of a project of many recordings, and the next command.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace cairn::apps {

[[nodiscard]] bool is_project_folder(const std::filesystem::path& folder);

/// Prints the recordings, segments, maps and cells of a project, the missing results, the verdict, and the
/// next command.
void print_project_info(const std::filesystem::path& plan, bool as_json);

/// Next command of a project, with the number of remaining similar commands: "cairn tile ... (the first of 3 cells)".
[[nodiscard]] std::string next_project_command(const std::filesystem::path& plan);

/// Names of the recordings that are partly or completely missing in a project's map, named as by short_names().
[[nodiscard]] std::vector<std::string> missing_recordings(const std::filesystem::path& plan);

/// Throws std::runtime_error for a file or folder inside a project or map that is neither a map nor a recording; the
/// message has its kind and the command to use. Accepts a project itself.
void refuse_internal_files(const std::filesystem::path& path);

}  // namespace cairn::apps
