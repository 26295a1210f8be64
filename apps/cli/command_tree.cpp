// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/command_tree.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>

#include "cli/quantity.hpp"
#include "cli/suggest.hpp"

namespace cairn::apps {
namespace {

using Kind = Value::Kind;

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  while (true) {
    const std::size_t end = std::min(text.find(separator), text.size());
    parts.emplace_back(text.substr(0, end));
    if (end == text.size()) return parts;
    text.remove_prefix(end + 1);
  }
}

/// Text between `left` and `right`; empty if either is missing.
std::string between(std::string_view text, std::string_view left, std::string_view right) {
  const std::size_t begin = text.find(left);
  if (begin == text.npos) return {};
  const std::size_t end = text.find(right, begin + left.size());
  return end == text.npos ? std::string() : std::string(text.substr(begin + left.size(), end - begin - left.size()));
}

/// Rewrites numbers such as "1e+09" or "0.00100000004" for readers.
std::string number(const std::string& text) {
  if (text.find_first_not_of("0123456789") == text.npos) return text;
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return end == text.c_str() || *end != '\0' ? text : fmt::format("{}", static_cast<float>(value));
}

/// Words of "{a,b}" and of "value in {a->0,b->1} OR {0,1}".
std::vector<std::string> choices_in(const std::string& description) {
  std::vector<std::string> words;
  for (const std::string& word : split(between(description, "{", "}"), ','))
    if (!word.empty()) words.push_back(word.substr(0, word.find("->")));
  return words;
}

Kind kind_of(const std::string& type) {
  if (type == "FILE") return Kind::file;
  if (type == "DIR" || type == kFolder) return Kind::folder;
  if (type == "PATH(existing)" || type == kPath) return Kind::path;
  if (type == "INT" || type == "UINT") return Kind::integer;
  if (type == "FLOAT") return Kind::number;
  return Kind::text;
}

std::string placeholder_of(Kind kind) {
  switch (kind) {
    case Kind::none:
      return {};
    case Kind::file:
      return "FILE";
    case Kind::folder:
      return "FOLDER";
    case Kind::path:
      return "PATH";
    case Kind::choice:
      return "WORD";
    case Kind::integer:
      return "N";
    case Kind::number:
      return "NUMBER";
    case Kind::text:
      return "TEXT";
  }
  return {};
}

bool mentions(const std::string& text, const std::vector<std::string>& words) {
  return std::all_of(words.begin(), words.end(), [&](const auto& word) { return text.find(word) != text.npos; });
}

std::string names_text(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  names.reserve(options.size());
  for (const CLI::Option* option : options) names.push_back(option->get_name());
  std::sort(names.begin(), names.end());  // the set is ordered by address
  return join_choices(names);
}

}  // namespace

CLI::Validator detail::choice_validator(const std::vector<std::string>& words, const std::vector<std::string>& values) {
  const std::string description = fmt::format("{{{}}}", fmt::join(words, ","));
  return CLI::Validator(
      [words, values](std::string& word) -> std::string {
        const auto it = std::find(words.begin(), words.end(), word);
        if (it != words.end()) word = values[static_cast<std::size_t>(it - words.begin())];
        return it != words.end() ? "" : "choose " + join_choices(words) + did_you_mean(word, words);
      },
      description);
}

CLI::Validator one_of(const std::vector<std::string>& words) { return detail::choice_validator(words, words); }

Value value_of(const CLI::Option& option) {
  Value value;
  if (option.get_items_expected_max() == 0 || option.get_type_size_max() == 0) return value;
  // The type, followed by the descriptions of the checks, separated by colons.
  const auto types = split(option.get_type_name(), ':');
  value.kind = kind_of(types[0]);
  for (std::size_t i = 1; i < types.size(); ++i) {
    if (const Kind checked = kind_of(types[i]); checked != Kind::text && value.kind == Kind::text) value.kind = checked;
    if (auto choices = choices_in(types[i]); !choices.empty()) {
      value.kind = Kind::choice;
      value.choices = std::move(choices);
    }
    if (const std::string check = std::string(kQuantity) + ' '; types[i].starts_with(check)) {
      const std::size_t end = types[i].find(' ', check.size());
      value.placeholder = types[i].substr(check.size(), end - check.size());
      value.range = types[i].substr(end + 1);
    }
  }
  const bool is_named = value.kind == Kind::text && types[0] != "TEXT" && types[0] != "ENUM" && !types[0].empty();
  if (value.placeholder.empty()) value.placeholder = is_named ? types[0] : placeholder_of(value.kind);
  if (option.get_expected_min() > 1 && !is_named) {
    const std::string one = value.placeholder;
    for (int i = 1; i < std::min(option.get_expected_min(), 3); ++i) value.placeholder += ' ' + one;
    if (option.get_expected_min() > 3) value.placeholder = one + " ...";  // the help text states the number
  }
  return value;
}

std::vector<const CLI::App*> commands_of(const CLI::App& command) {
  return command.get_subcommands([](const CLI::App* c) { return !c->get_name().empty() && !c->get_group().empty(); });
}

std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* o) { return o->nonpositional() && !o->get_group().empty(); });
}

std::vector<const CLI::Option*> positionals_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* o) { return o->get_positional() && !o->get_group().empty(); });
}

std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

std::vector<std::string> names_of(const std::vector<const CLI::App*>& commands) {
  std::vector<std::string> names;
  names.reserve(commands.size());
  for (const CLI::App* command : commands) names.push_back(command->get_name());
  return names;
}

std::vector<std::string> names_of(const std::vector<const CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options)
    for (std::string& name : names_of(*option)) names.push_back(std::move(name));
  return names;
}

std::string full_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return (parent != nullptr ? full_name(*parent) + " " : "") + command.get_name();
}

std::string usage_of(const CLI::App& command) {
  std::string usage = full_name(command);
  if (!commands_of(command).empty()) return usage + " COMMAND [options]";
  usage += " [options]";
  const auto optional = [](const CLI::Option& option, const std::string& text) {
    return option.get_required() ? " " + text : " [" + text + "]";
  };
  for (const CLI::Option* option : positionals_of(command))
    usage += optional(*option, option->get_name(true) + (option->get_expected_max() > 1 ? "..." : ""));
  for (const CLI::Option* option : options_of(command))
    if (option->get_required() && !option->get_positional())
      usage += " " + names_of(*option)[0] + " " + value_of(*option).placeholder;
  return usage;
}

std::string description_of(const CLI::Option& option) {
  const Value value = value_of(option);
  std::string text = option.get_description();
  // The default is in brackets at the end of the text.
  std::string default_value = option.get_default_str();
  if (const std::size_t bracket = text.rfind(" [");
      value.kind != Kind::none && text.ends_with(']') && bracket != text.npos) {
    default_value = text.substr(bracket + 2, text.size() - bracket - 3);
    text.resize(bracket);
  }
  if (value.kind == Kind::choice && !mentions(text, value.choices)) text += ": " + join_choices(value.choices);
  if (!value.range.empty() && text.find(value.range) == text.npos) text += "; " + value.range;
  if (!option.get_needs().empty()) text += "; with " + names_text(option.get_needs());
  if (!option.get_excludes().empty()) text += "; not with " + names_text(option.get_excludes());
  if (!default_value.empty()) text += " [" + number(default_value) + "]";
  return text;
}

}  // namespace cairn::apps
