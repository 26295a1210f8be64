// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cairn::apps {

/// Formatter of `--help`: as wide as the terminal, at most 100 columns.
[[nodiscard]] std::shared_ptr<CLI::FormatterBase> help_format();
/// Help text wrapped at `columns`.
[[nodiscard]] std::string help_text(const CLI::App& command, int columns);

/// Text printed by `cairn` without arguments, an introduction wrapped at `columns`.
[[nodiscard]] std::string introduction(int columns);

/// The manual in roff's man macros, with all commands and options.
[[nodiscard]] std::string man_page(const CLI::App& program);

/// One-line reason for a refused command line, with the remedy; `words` exclude the program's name.
[[nodiscard]] std::string usage_error(const CLI::App& program, const std::vector<std::string>& words,
                                      const CLI::ParseError& error);
/// Error for a word that is not a command or not an option of its command; empty if all words are known. Checked first,
/// because CLI11 would report missing arguments first.
[[nodiscard]] std::optional<std::string> unknown_word(const CLI::App& program, const std::vector<std::string>& words);
/// The command named by the words.
[[nodiscard]] const CLI::App& command_in(const CLI::App& program, const std::vector<std::string>& words);

}  // namespace cairn::apps
