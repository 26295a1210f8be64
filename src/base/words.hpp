// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Words of text files: conversion to numbers, and display in messages.
#pragma once
#include <charconv>
#include <optional>
#include <string>
#include <string_view>

namespace cairn {

/// Parses a number, including nan and inf; nullopt for other text. Independent of the locale.
template <class Number = double>
[[nodiscard]] std::optional<Number> number_in(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  Number value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

/// Makes file content safe for a message: short, in one line, without control characters or quotes, because messages
/// put quotes around it.
[[nodiscard]] std::string shown(std::string_view text);

}  // namespace cairn
