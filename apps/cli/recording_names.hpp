// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace cairn::apps {

/// Recordings of a project, named as in `cairn plan`. Throws like read_plan().
[[nodiscard]] std::vector<std::string> recordings_in(const std::filesystem::path& plan);

/// Short names: removes the common beginning and end of all names, then keeps the fewest last words that differ.
/// /data/monday and /home/me/tuesday become monday and tuesday; a single name keeps its last word.
[[nodiscard]] std::vector<std::string> short_names(const std::vector<std::string>& names);

/// Index of the recording for a word: a number counted from 0, a name, or a short name. Throws std::runtime_error with
/// all names if the word is unknown or ambiguous.
[[nodiscard]] std::size_t find_recording(const std::string& word, const std::vector<std::string>& names);

}  // namespace cairn::apps
