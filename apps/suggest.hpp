// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace cairn::apps {

/// Letters that are to be put in, left out, changed or swapped with their neighbour to make one word of the other:
/// optimal string alignment (Damerau 1964), upper case as lower case.
[[nodiscard]] int edit_distance(std::string_view a, std::string_view b);

/// What was meant by a mistyped word: the nearest of `known`, or all that it is the beginning of; nothing where none is
/// near.
[[nodiscard]] std::vector<std::string> near_words(std::string_view typed, const std::vector<std::string>& known);

/// The same as the end of a message: "; did you mean reconstruct?", or nothing.
[[nodiscard]] std::string did_you_mean(std::string_view typed, const std::vector<std::string>& known);

/// "a", "a or b", "a, b or c".
[[nodiscard]] std::string one_of_words(const std::vector<std::string>& words);

}  // namespace cairn::apps
