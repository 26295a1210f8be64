// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The program's commands and options as defined in CLI11: the source of help, messages, completion and the man page.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

namespace cairn::apps {

/// Value of an option or a positional.
struct Value {
  enum class Kind { none, file, folder, path, choice, integer, number, text };
  Kind kind = Kind::none;
  std::vector<std::string> choices;
  std::string range;        ///< "0 to 65535", "more than 0"; empty: unlimited
  std::string placeholder;  ///< FILE, N, WORD, ...; empty for a flag
};
[[nodiscard]] Value value_of(const CLI::Option& option);

/// Type names of paths that need not exist yet; CLI11 knows only text.
inline constexpr const char *kFile = "FILE", *kFolder = "FOLDER", *kPath = "PATH";

/// Check that the value is in the list; its error message suggests the nearest word.
[[nodiscard]] CLI::Validator one_of(const std::vector<std::string>& words);
/// The same check for words that map to values.
template <class T>
[[nodiscard]] CLI::Validator one_of(std::vector<std::pair<std::string, T>> words);

/// Subcommands, options and positionals of a command that a user may give, in the order of the help.
[[nodiscard]] std::vector<const CLI::App*> commands_of(const CLI::App& command);
[[nodiscard]] std::vector<const CLI::Option*> options_of(const CLI::App& command);
[[nodiscard]] std::vector<const CLI::Option*> positionals_of(const CLI::App& command);
/// "-o", "--output": short names first.
[[nodiscard]] std::vector<std::string> names_of(const CLI::Option& option);
[[nodiscard]] std::vector<std::string> names_of(const std::vector<const CLI::App*>& commands);
[[nodiscard]] std::vector<std::string> names_of(const std::vector<const CLI::Option*>& options);

/// "cairn evaluate mesh".
[[nodiscard]] std::string full_name(const CLI::App& command);
/// "cairn evaluate mesh [options] ESTIMATE TRUTH", with the required options.
[[nodiscard]] std::string usage_of(const CLI::App& command);
/// Description of an option, with range, default, requirements and exclusions.
[[nodiscard]] std::string description_of(const CLI::Option& option);

/// Calls `visit(command)` for the command and all its descendants.
template <class Visit>
void for_each_command(const CLI::App& command, const Visit& visit) {
  visit(command);
  for (const CLI::App* subcommand : commands_of(command)) for_each_command(*subcommand, visit);
}

// Implementation.

namespace detail {
[[nodiscard]] CLI::Validator choice_validator(const std::vector<std::string>& words,
                                              const std::vector<std::string>& values);
}

template <class T>
CLI::Validator one_of(std::vector<std::pair<std::string, T>> words) {
  std::vector<std::string> names, values;
  for (const auto& [name, value] : words) {
    names.push_back(name);
    values.push_back(std::to_string(static_cast<int>(value)));  // CLI11's text for enums and bools
  }
  return detail::choice_validator(names, values);
}

}  // namespace cairn::apps
