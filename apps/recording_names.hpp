// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::apps {

/// A plan's recordings, as `cairn plan` names them. Throws as read_plan() does.
[[nodiscard]] std::vector<std::string> recordings_in(const std::filesystem::path& plan);

/// Recordings' names without what all of them share at their beginnings and ends, and of the rest the fewest last words
/// that differ: /data/monday and /home/me/tuesday become monday and tuesday, a single one its last word.
[[nodiscard]] std::vector<std::string> told_apart(const std::vector<std::string>& names);

/// The one that a word means: a number, counted from 0, a name, or one told apart. Throws std::runtime_error that names
/// all where it is none, or more than one.
[[nodiscard]] std::size_t recording_named(const std::string& word, const std::vector<std::string>& names);

}  // namespace cairn::apps
