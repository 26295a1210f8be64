// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A plan of many recordings: how far it is, and what comes next.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace cairn::apps {

[[nodiscard]] bool holds_plan(const std::filesystem::path& folder);

/// Prints a plan's recordings, parts, maps and cells, what is made of them and what is missing, whether all is joined,
/// and the next command.
void print_plan_info(const std::filesystem::path& plan, bool as_json);

/// The command that a plan needs next, and how many like it are left: "cairn tile ... (the first of 3 cells)".
[[nodiscard]] std::string next_of_plan(const std::filesystem::path& plan);

/// Names of the recordings that are not in a plan's map, or not whole: as told_apart() names them.
[[nodiscard]] std::vector<std::string> missing_recordings(const std::filesystem::path& plan);

/// Throws std::runtime_error for a file or folder of a plan or a map that is neither a map nor a recording, with its
/// kind and the command for it; a plan itself is none of these.
void refuse_pieces(const std::filesystem::path& path);

}  // namespace cairn::apps
