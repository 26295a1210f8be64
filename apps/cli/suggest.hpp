// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace cairn::apps {

/// Edit distance with insertions, deletions, substitutions and swaps of adjacent letters: optimal string alignment
/// (Damerau 1964), case-insensitive.
[[nodiscard]] int edit_distance(std::string_view a, std::string_view b);

/// Suggestions for a mistyped word: the nearest of `known`, or all words it is a prefix of; empty if no word is near.
[[nodiscard]] std::vector<std::string> near_words(std::string_view typed, const std::vector<std::string>& known);

/// Suggestions as the end of a message: "; did you mean reconstruct?", or empty.
[[nodiscard]] std::string did_you_mean(std::string_view typed, const std::vector<std::string>& known);

/// "a", "a or b", "a, b or c".
[[nodiscard]] std::string join_choices(const std::vector<std::string>& words);

}  // namespace cairn::apps
