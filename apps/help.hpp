// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cairn::apps {

/// How `--help` looks: as wide as the terminal, 100 columns at most.
[[nodiscard]] std::shared_ptr<CLI::FormatterBase> help_format();
/// The same in so many columns.
[[nodiscard]] std::string help_text(const CLI::App& command, int columns);

/// What `cairn` alone prints, in lines of at most so many columns: how to begin.
[[nodiscard]] std::string first_words(int columns);

/// The manual in roff's man macros: all commands and options.
[[nodiscard]] std::string man_page(const CLI::App& program);

/// Why the command line was refused, in one line with the remedy; `words` are those behind the program's name.
[[nodiscard]] std::string usage_error(const CLI::App& program, const std::vector<std::string>& words,
                                      const CLI::ParseError& error);
/// A word that is no command, or no option of its command, told as above; nothing if all are known. CLI11 would name
/// what is missing first.
[[nodiscard]] std::optional<std::string> unknown_word(const CLI::App& program, const std::vector<std::string>& words);
/// The command that the words name.
[[nodiscard]] const CLI::App& command_in(const CLI::App& program, const std::vector<std::string>& words);

}  // namespace cairn::apps
