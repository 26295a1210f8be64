// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/help.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>

#include "cli/command_tree.hpp"
#include "cli/console.hpp"

namespace cairn::apps {
namespace {

constexpr int kMaxColumns = 100, kNameColumns = 26;  // columns of a line, and of its names

/// Formats a name and its description, in two columns if the width allows.
std::string entry(const std::string& name, const std::string& text, int columns) {
  const int indent = columns < kNarrow ? 6 : kNameColumns;
  std::string line = "  " + name;
  if (width_of(line) + 2 > indent)
    line += '\n' + std::string(static_cast<std::size_t>(indent), ' ');
  else
    line += std::string(static_cast<std::size_t>(indent - width_of(line)), ' ');
  return line + wrapped(text, indent, indent, columns) + '\n';
}

std::string heading_of(const CLI::Option& option) {
  std::vector<std::string> names = names_of(option);
  if (option.get_positional()) names.insert(names.begin(), option.get_name(true));
  const std::string name = fmt::format("{}", fmt::join(names, ", "));
  const std::string placeholder = value_of(option).placeholder;
  return option.get_positional() || placeholder.empty() ? name : name + " " + placeholder;
}

class Format final : public CLI::FormatterBase {
 public:
  std::string make_help(const CLI::App* command, std::string, CLI::AppFormatMode) const override {
    const Terminal terminal = terminal_of(STDOUT_FILENO);
    return help_text(*command, std::min(terminal.columns, kMaxColumns));
  }
};

}  // namespace

std::shared_ptr<CLI::FormatterBase> help_format() { return std::make_shared<Format>(); }

std::string help_text(const CLI::App& command, int columns) {
  std::string text = wrapped(command.get_description(), 0, 0, columns) + "\n\n";
  text += "usage: " + wrapped(usage_of(command), 7, 9, columns) + '\n';
  std::string group;
  for (const CLI::App* subcommand : commands_of(command)) {
    if (subcommand->get_group() != group) text += "\n" + (group = subcommand->get_group()) + ":\n";
    text += entry(subcommand->get_name(), subcommand->get_description(), columns);
  }
  if (const auto positionals = positionals_of(command); !positionals.empty()) {
    text += '\n';
    for (const CLI::Option* option : positionals) text += entry(heading_of(*option), description_of(*option), columns);
  }
  for (const std::string& title : command.get_groups()) {
    std::string entries;
    for (const CLI::Option* option : options_of(command))
      if (option->get_group() == title && !option->get_positional())
        entries += entry(heading_of(*option), description_of(*option), columns);
    if (!entries.empty()) text.append("\n").append(title).append(":\n").append(entries);
  }
  if (!command.get_footer().empty()) text += '\n' + command.get_footer() + '\n';
  return text;
}

}  // namespace cairn::apps
