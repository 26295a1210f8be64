// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Words of text files: the numbers that they are, and how messages show them.
#pragma once
#include <charconv>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// The number that a word is, also nan or inf; nothing if it is none. The same in every locale.
template <class Number = double>
[[nodiscard]] std::optional<Number> number_in(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  Number value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

/// What a file says as a message may show it: short, in one line, without characters that a terminal obeys and without
/// quotes, which stand around it.
[[nodiscard]] std::string shown(std::string_view text);

}  // namespace cairn
