// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Progress of a plan of many recordings, and the next command.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace cairn::apps {

[[nodiscard]] bool holds_plan(const std::filesystem::path& folder);

/// Prints the recordings, parts, maps and cells of a plan, the missing results, whether all parts are joined, and the
/// next command.
void print_plan_info(const std::filesystem::path& plan, bool as_json);

/// Next command of a plan, with the number of remaining similar commands: "cairn tile ... (the first of 3 cells)".
[[nodiscard]] std::string next_of_plan(const std::filesystem::path& plan);

/// Names of the recordings that are partly or completely missing in a plan's map, named as by told_apart().
[[nodiscard]] std::vector<std::string> missing_recordings(const std::filesystem::path& plan);

/// Throws std::runtime_error for a file or folder inside a plan or map that is neither a map nor a recording; the
/// message has its kind and the command to use. Accepts a plan itself.
void refuse_pieces(const std::filesystem::path& path);

}  // namespace cairn::apps
