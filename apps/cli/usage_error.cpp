// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Messages for wrong command lines, with the remedy.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "cli/command_tree.hpp"
#include "cli/help.hpp"
#include "cli/quantity.hpp"
#include "cli/suggest.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Kind = Value::Kind;
using Arguments = std::vector<std::string>;

const CLI::App* subcommand_named(const CLI::App& command, const std::string& name) {
  for (const CLI::App* one : commands_of(command))
    if (one->check_name(name)) return one;
  return nullptr;
}

/// Appends a reference to the help; after a question, as its own sentence.
std::string refer_to_help(const CLI::App& command, const std::string& message) {
  return fmt::format("{}{} `{} --help`", message, message.ends_with('?') ? " See" : "; see", full_name(command));
}

/// Option name in "--port=80" or "-o".
std::string option_name(const std::string& word) { return word.substr(0, word.find('=')); }

/// Returns true for negative numbers, and for -inf and -nan, for which the option has its own error.
bool is_number(const std::string& word) {
  if (word == "-inf" || word == "-nan" || word == "-infinity") return true;
  return word.size() > 1 && word[0] == '-' &&
         (std::isdigit(static_cast<unsigned char>(word[1])) != 0 || word[1] == '.');
}

/// Files beside a missing file with similar names.
std::string suggest_file(const fs::path& missing, bool folders) {
  const fs::path folder = missing.has_parent_path() ? missing.parent_path() : fs::path(".");
  std::error_code error;
  if (!fs::is_directory(folder, error)) return ": there is no folder " + folder.string();
  Arguments names;
  for (const auto& file : fs::directory_iterator(folder, error))
    if (names.size() < 1000 && file.is_directory(error) == folders) names.push_back(file.path().filename().string());
  std::sort(names.begin(), names.end());
  std::string text = did_you_mean(missing.filename().string(), names);
  return text.empty() ? ""
                      : text.insert(text.find("mean ") + 5, missing.has_parent_path() ? (folder / "").string() : "");
}

/// Rewrites CLI11's message for a wrong option value.
std::string wrong_value(const CLI::Option& option, std::string why) {
  const Value value = value_of(option);
  const Arguments& given = option.results();
  const std::string word = given.empty() ? "" : given.back();
  const std::string named = option.get_name() + (word.empty() ? "" : " " + word);
  if (const std::size_t name = why.find(": "); name != why.npos && why.starts_with(option.get_name()))
    why.erase(0, name + 2);
  if (why.find("does not exist") != why.npos) {
    const bool is_folder = value.kind == Kind::folder;
    const fs::path file = why.substr(why.find(": ") + 2);
    return fmt::format("{} {}: there is no such {}{}", option.get_name(), file.string(),
                       value.kind == Kind::path ? "file or folder"
                       : is_folder              ? "folder"
                                                : "file",
                       suggest_file(file, is_folder));
  }
  if (why.starts_with("File is actually a directory")) return named + ": is a folder, name a file";
  if (why.starts_with("Directory is actually a file")) return named + ": is a file, name a folder";
  if (value.kind == Kind::choice && !why.starts_with("choose "))
    return fmt::format("{}: choose {}{}", named, join_choices(value.choices), did_you_mean(word, value.choices));
  if (why.find(kNumberExpected) != why.npos) return option.get_name() + " " + why;
  return why.starts_with("choose ") ? named + ": " + why : fmt::format("{}: {}", option.get_name(), why);
}

const CLI::Option* option_named(const CLI::App& command, const std::string& message) {
  const CLI::Option* found = nullptr;
  for (const auto& options : {options_of(command), positionals_of(command)})
    for (const CLI::Option* option : options)
      if (const std::string name = option->get_name();
          message.find(name) != message.npos && (found == nullptr || name.size() > found->get_name().size()))
        found = option;
  return found;
}

std::string join(const Arguments& arguments) {
  std::string text;
  for (const std::string& word : arguments) text += (text.empty() ? "" : " ") + word;
  return text;
}

}  // namespace

const CLI::App& command_in(const CLI::App& program, const Arguments& arguments) {
  const CLI::App* command = &program;
  for (const std::string& word : arguments) {
    if (commands_of(*command).empty()) break;
    if (const CLI::App* next = subcommand_named(*command, word)) command = next;
  }
  return *command;
}

std::optional<std::string> unknown_word(const CLI::App& program, const Arguments& arguments) {
  const CLI::App* command = &program;
  for (const std::string& word : arguments) {
    if (word == "--") break;
    const Arguments commands = names_of(commands_of(*command));
    if (word.size() > 1 && word[0] == '-' && !is_number(word)) {
      const std::string name = option_name(word);
      const bool is_short = name[1] != '-';
      if (command->get_option_no_throw(is_short ? name.substr(0, 2) : name) != nullptr) continue;
      const std::string meant = did_you_mean(name, names_of(options_of(*command)));
      return refer_to_help(*command, fmt::format("{}: there is no option {}{}", full_name(*command), name, meant));
    }
    if (commands.empty()) continue;
    const CLI::App* next = subcommand_named(*command, word);
    if (next == nullptr)
      return refer_to_help(*command, fmt::format("{}: there is no command {}{}", full_name(*command), word,
                                                 did_you_mean(word, commands)));
    command = next;
  }
  return std::nullopt;
}

std::string usage_error(const CLI::App& program, const Arguments& arguments, const CLI::ParseError& error) {
  const CLI::App& command = command_in(program, arguments);
  const std::string what = error.what(), kind = error.get_name(), name = full_name(command);
  if (const auto subcommands = commands_of(command); !subcommands.empty())
    return refer_to_help(command, fmt::format("{}: choose a command: {}", name, join_choices(names_of(subcommands))));
  const CLI::Option* option = option_named(command, what);
  if (kind == "RequiredError" && option != nullptr)
    return refer_to_help(
        command, fmt::format("{}: {} is missing: {}", name,
                             option->get_positional() ? option->get_name(true)
                                                      : option->get_name() + " " + value_of(*option).placeholder,
                             usage_of(command)));
  if (kind == "ArgumentMismatch" && option != nullptr) {
    const std::string placeholder = value_of(*option).placeholder;
    return refer_to_help(command, fmt::format("{}: {} takes {}", name, option->get_name(),
                                              placeholder.empty() ? "no value" : placeholder));
  }
  if (kind == "RequiresError") {
    const std::size_t middle = what.find(" requires ");
    return refer_to_help(command,
                         fmt::format("{}: {} needs {}", name, what.substr(0, middle), what.substr(middle + 10)));
  }
  if (kind == "ExcludesError") {
    const std::size_t middle = what.find(" excludes ");
    return fmt::format("{}: {} and {} exclude each other: leave one out", name, what.substr(0, middle),
                       what.substr(middle + 10));
  }
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {  // get_name() of this error is the command's name
    const Arguments extra = command.remaining();
    return refer_to_help(command, fmt::format("{}: unexpected argument {}: {}", name, join(extra), usage_of(command)));
  }
  if ((kind == "ValidationError" || kind == "ConversionError") && option != nullptr)
    return fmt::format("{}: {}", name, wrong_value(*option, what));
  return refer_to_help(command, name + ": " + what);
}

}  // namespace cairn::apps
