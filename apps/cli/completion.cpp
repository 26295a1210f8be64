// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Command-line completion for bash, zsh and fish, generated from the program's commands and options.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>

#include "cli/command_tree.hpp"
#include "cli/commands.hpp"

namespace cairn::apps {
namespace {

using Kind = Value::Kind;

std::string replaced(std::string text, const std::string& pattern, const std::string& replacement) {
  for (std::size_t at = text.find(pattern); at != text.npos; at = text.find(pattern, at + replacement.size()))
    text.replace(at, pattern.size(), replacement);
  return text;
}

std::string shell_quotes(const std::string& text) { return "'" + replaced(text, "'", "'\\''") + "'"; }

std::string join(const std::vector<std::string>& list) { return fmt::format("{}", fmt::join(list, " ")); }

/// Path of a command: "", "/evaluate", "/evaluate/mesh".
std::string path_of(const CLI::App& command) {
  return command.get_parent() == nullptr ? "" : path_of(*command.get_parent()) + "/" + command.get_name();
}

bool is_leaf(const CLI::App& command) { return commands_of(command).empty(); }

// bash

std::string bash_value(const Value& value) {
  switch (value.kind) {
    case Kind::choice:
      return fmt::format("COMPREPLY=($(compgen -W {} -- \"$cur\"))", shell_quotes(join(value.choices)));
    case Kind::folder:
      return "_cairn_files -d";
    case Kind::file:
    case Kind::path:
      return "_cairn_files -f";
    default:
      return "return";
  }
}

/// Placeholders: options that take a value, the values, transitions from word to command, and the entries of each
/// command.
constexpr char kBash[] = R"~(# Completion of cairn in bash, made by `cairn completion bash`.
_cairn_takes_value() {{
  case $1 in
{}  esac
  return 1
}}
_cairn_files() {{
  compopt -o filenames 2>/dev/null
  mapfile -t COMPREPLY < <(compgen "$1" -- "$cur")
}}
_cairn_value() {{
  case $1 in
{}  esac
}}
_cairn() {{
  local cur=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} path= at=0 i word options= commands=
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${{COMP_WORDS[i]}}
    [[ $path$word != help ]] || continue
    case $path:$word in
{}      *:-*) ! _cairn_takes_value "$path:$word" || [[ ${{COMP_WORDS[i+1]}} == '=' ]] || ((++i)) ;;
      *) ((++at)) ;;
    esac
  done
  if [[ $cur == '=' ]]; then
    cur=
  elif [[ $before == '=' ]]; then
    before=${{COMP_WORDS[COMP_CWORD-2]}}
  fi
  if _cairn_takes_value "$path:$before"; then
    _cairn_value "$path:$before"
    return
  fi
  case $path in
{}  esac
  if [[ $cur == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$cur")
    return
  fi
  if [[ -n $commands ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$cur")
  else
    _cairn_value "$path:$at"
  fi
}}
complete -F _cairn cairn
)~";

std::string bash(const CLI::App& program) {
  std::string edges, takes, values, lists;
  for_each_command(program, [&](const CLI::App& command) {
    const std::string path = path_of(command);
    for (const CLI::App* subcommand : commands_of(command))
      edges += fmt::format("      {0}:{1}) path={0}/{1} at=0 ;;\n", path, subcommand->get_name());
    for (const CLI::Option* option : options_of(command)) {
      const Value value = value_of(*option);
      if (value.kind == Kind::none) continue;
      std::string pattern;
      for (const std::string& name : names_of(*option))
        pattern += fmt::format("{}{}:{}", pattern.empty() ? "" : "|", path, name);
      takes += fmt::format("    {}) return 0 ;;\n", pattern);
      values += fmt::format("    {}) {}; return ;;\n", pattern, bash_value(value));
    }
    const auto positionals = positionals_of(command);
    for (std::size_t i = 0; i < positionals.size(); ++i) {
      const bool is_repeated = positionals[i]->get_expected_max() > 1;
      values += fmt::format("    {}:{}) {}; return ;;\n", path, is_repeated ? "[0-9]*" : std::to_string(i),
                            bash_value(value_of(*positionals[i])));
    }
    lists += fmt::format("    {}) options={} commands={} ;;\n", path.empty() ? "''" : path,
                         shell_quotes(join(names_of(options_of(command)))),
                         shell_quotes(join(names_of(commands_of(command)))));
  });
  return fmt::format(kBash, takes, values, edges, lists);
}

// zsh

std::string zsh_value(const Value& value) {
  switch (value.kind) {
    case Kind::choice:
      return "(" + join(value.choices) + ")";
    case Kind::folder:
      return "_files -/";
    case Kind::file:
    case Kind::path:
      return "_files";
    default:
      return " ";
  }
}

/// Escapes text within a specification of _arguments.
std::string zsh_text(std::string text) {
  for (const char* special : {"\\", "[", "]", ":", "`", "$"})
    text = replaced(text, special, "\\" + std::string(special));
  return text;
}

std::string zsh_arguments(const CLI::App& command) {
  std::string lines;
  for (const CLI::Option* option : options_of(command)) {
    const Value value = value_of(*option);
    for (const std::string& name : names_of(*option)) {
      std::string spec = (name.starts_with("--") && value.kind != Kind::none ? name + "=" : name) + "[" +
                         zsh_text(description_of(*option)) + "]";
      if (value.kind != Kind::none) spec += ":" + value.placeholder + ":" + zsh_value(value);
      lines += " \\\n      " + shell_quotes(spec);
    }
  }
  int at = 0;
  for (const CLI::Option* option : positionals_of(command)) {
    const std::string where = option->get_expected_max() > 1 ? "*" : std::to_string(++at);
    lines += " \\\n      " + shell_quotes(where + ":" + option->get_name(true) + ":" + zsh_value(value_of(*option)));
  }
  return lines;
}

std::string zsh(const CLI::App& program) {
  std::string functions;
  for_each_command(program, [&](const CLI::App& command) {
    const std::string name = "_cairn" + replaced(path_of(command), "/", "_");
    std::string body;
    if (is_leaf(command)) {
      body = "  _arguments -S" + zsh_arguments(command) + "\n";
    } else {
      std::string described, cases;
      for (const CLI::App* subcommand : commands_of(command)) {
        described += "\n    " + shell_quotes(subcommand->get_name() + ":" + zsh_text(subcommand->get_description()));
        cases += fmt::format("    {0}) {1}_{0} ;;\n", subcommand->get_name(), name);
      }
      body = fmt::format(
          "  local context state line\n  local -a commands\n  commands=({}\n  )\n"
          "  _arguments -C{} \\\n      '1:command:->command' '*::argument:->argument'\n"
          "  case $state in\n  command) _describe -t commands command commands ;;\n"
          "  argument) case $words[1] in\n{}    esac ;;\n  esac\n",
          described, zsh_arguments(command), cases);
    }
    functions += name + "() {\n" + body + "}\n";
  });
  // `cairn help` accepts the same words as `cairn`.
  functions = replaced(functions, "    help) _cairn_help ;;\n", "    help) _cairn ;;\n");
  return "#compdef cairn\n# Completion of cairn in zsh, made by `cairn completion zsh`.\n" + functions +
         "if [[ $funcstack[1] == _cairn ]]; then _cairn \"$@\"; else compdef _cairn cairn; fi\n";
}

// fish

std::string fish_quotes(const std::string& text) {
  return "'" + replaced(replaced(text, "\\", "\\\\"), "'", "\\'") + "'";
}

std::string fish_value(const Value& value) {
  switch (value.kind) {
    case Kind::none:
      return "";
    case Kind::choice:
      return " -x -a " + fish_quotes(join(value.choices));
    case Kind::folder:
      return " -x -a '(__fish_complete_directories)'";
    case Kind::file:
    case Kind::path:
      return " -r -F";
    default:
      return " -x";
  }
}

std::string fish(const CLI::App& program) {
  std::string lines = "complete -c cairn -f\n";
  for_each_command(program, [&](const CLI::App& command) {
    const std::string prefix = "complete -c cairn -n '__cairn_at " + full_name(command).substr(5) + "'";
    for (const CLI::App* subcommand : commands_of(command))
      lines += prefix + " -a " + subcommand->get_name() + " -d " + fish_quotes(subcommand->get_description()) + "\n";
    for (const CLI::Option* option : options_of(command)) {
      lines += prefix;
      for (const std::string& name : names_of(*option))
        lines += (name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1));
      lines += fish_value(value_of(*option)) + " -d " + fish_quotes(description_of(*option)) + "\n";
    }
    for (const CLI::Option* option : positionals_of(command))
      if (const std::string value = fish_value(value_of(*option)); value != " -x")
        lines += prefix + (value == " -r -F" ? " -F" : value.substr(3)) + "\n";
  });
  std::string names;
  for_each_command(program, [&](const CLI::App& command) {
    if (!is_leaf(command))
      names += fmt::format("    case {}\n      set known {}\n", shell_quotes(path_of(command)),
                           join(names_of(commands_of(command))));
  });
  return fmt::format(R"~(# Completion of cairn in fish, made by `cairn completion fish`.
function __cairn_at
  set -l path ''
  for word in (commandline -opc)[2..]
    set -l known
    test "$path$word" = help; and continue
    switch $path
{}    end
    contains -- $word $known; and set path $path/$word
  end
  test "$path" = "$(string join '' /$argv)"
end
{})~",
                     names, lines);
}

}  // namespace

void add_completion(CLI::App& program) {
  auto* command = program.add_subcommand("completion", "Print the completion script for a shell");
  const auto shell = std::make_shared<std::string>();
  command->add_option("SHELL", *shell, "bash, zsh or fish")->required()->check(one_of({"bash", "zsh", "fish"}));
  command->footer(
      "bash:  cairn completion bash > ~/.local/share/bash-completion/completions/cairn\n"
      "zsh:   cairn completion zsh > FOLDER/_cairn    with FOLDER in $fpath\n"
      "fish:  cairn completion fish > ~/.config/fish/completions/cairn.fish");
  command->callback([&program, shell] {
    fmt::print("{}", *shell == "bash" ? bash(program) : *shell == "zsh" ? zsh(program) : fish(program));
  });
}

}  // namespace cairn::apps
