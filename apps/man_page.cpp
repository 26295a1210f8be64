// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// cairn(1) in roff's man macros (man 7 man).
#include <fmt/format.h>

#include "command_tree.hpp"
#include "exit_codes.hpp"
#include "help.hpp"

namespace cairn::apps {
namespace {

constexpr std::array<std::pair<const char*, const char*>, 5> kExamples{{
    {"cairn reconstruct FOLDER -o OUT", "A recording becomes a mesh, a map and a trajectory."},
    {"cairn view OUT", "Looks at it in a browser."},
    {"cairn export OUT -o X.glb --simplify 0.1 --texture", "A small textured mesh to share."},
    {"cairn live openni: -o OUT --view", "Maps what a depth camera sees, and shows how the map grows."},
    {"cairn esdf OUT --costmap X.yaml --height -1.0:0.4", "Occupancy for a robot."},
}};

/// Escapes text for roff.
std::string plain_text(const std::string& text) {
  std::string roff;
  for (const char c : text) {
    if (c == '\\')
      roff += "\\e";
    else if (c == '-')
      roff += "\\-";  // a hyphen that can be copied into a shell
    else
      roff += c;
  }
  return roff.starts_with('.') || roff.starts_with('\'') ? "\\&" + roff : roff;
}

std::string bold(const std::string& text) { return "\\fB" + plain_text(text) + "\\fR"; }

std::string entry(const std::string& name, const std::string& text) {
  return fmt::format(".TP\n{}\n{}\n", name, plain_text(text));
}

std::string name_of(const CLI::Option& option) {
  std::string names = option.get_positional() ? "\\fI" + plain_text(option.get_name(true)) + "\\fR" : "";
  for (const std::string& name : names_of(option)) names += (names.empty() ? "" : ", ") + bold(name);
  const std::string placeholder = value_of(option).placeholder;
  return option.get_positional() || placeholder.empty() ? names : names + " \\fI" + plain_text(placeholder) + "\\fR";
}

std::string section_of(const CLI::App& command) {
  std::string text = fmt::format(".SS {}\n{}.\n", plain_text(usage_of(command)), plain_text(command.get_description()));
  for (const CLI::Option* option : positionals_of(command)) text += entry(name_of(*option), meaning_of(*option));
  for (const CLI::Option* option : options_of(command))
    if (!option->get_positional() && option != command.get_help_ptr())
      text += entry(name_of(*option), meaning_of(*option));
  return text;
}

}  // namespace

std::string man_page(const CLI::App& program) {
  std::string page = fmt::format(
      ".\\\" Made by `cairn help --man`.\n.TH CAIRN 1 {} \"Cairn {}\" \"User Commands\"\n"
      ".SH NAME\ncairn \\- dense RGB\\-D mapping\n"
      ".SH SYNOPSIS\n{}\n"
      ".SH DESCRIPTION\n{}\n"
      ".PP\nEach command tells its options with {}, too.\n"
      ".SH COMMANDS\n",
      CAIRN_DATE, CAIRN_VERSION, bold(usage_of(program)), plain_text(program.get_description()), bold("--help"));
  for_each_command(program, [&](const CLI::App& command) {
    if (commands_of(command).empty()) page += section_of(command);
  });
  page += ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : kExitCodes) page += entry(bold(code), meaning);
  page += ".SH ENVIRONMENT\n";
  page += entry(bold("NO_COLOR"), "If it is set, nothing is coloured.");
  page += entry(bold("TERM"), "With dumb, progress comes in lines of its own.");
  page += entry(bold("XDG_CACHE_HOME"), "Where compiled kernels are kept, in cairn/ [~/.cache]");
  page += ".SH EXAMPLES\n";
  for (const auto& [words, meaning] : kExamples) page += entry(bold(words), meaning);
  return page;
}

}  // namespace cairn::apps
