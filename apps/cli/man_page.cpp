// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// cairn(1) in roff's man macros (man 7 man).
#include <fmt/format.h>

#include "cli/command_tree.hpp"
#include "cli/exit_codes.hpp"
#include "cli/help.hpp"

namespace cairn::apps {
namespace {

constexpr std::array<std::pair<const char*, const char*>, 5> kExamples{{
    {"cairn reconstruct FOLDER -o OUT", "Reconstruct a mesh, a map and a trajectory from a recording."},
    {"cairn view OUT", "Show the result in a browser."},
    {"cairn export OUT -o X.glb --simplify 0.1 --texture", "Export a small textured mesh."},
    {"cairn live openni: -o OUT --view", "Map with a depth camera in real time, and show the growing map."},
    {"cairn esdf OUT --costmap X.yaml --height -1.0:0.4", "Write a costmap for a robot."},
}};

/// Escapes text for roff.
std::string escape(const std::string& text) {
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

std::string bold(const std::string& text) { return "\\fB" + escape(text) + "\\fR"; }

std::string entry(const std::string& name, const std::string& text) {
  return fmt::format(".TP\n{}\n{}\n", name, escape(text));
}

std::string heading_of(const CLI::Option& option) {
  std::string names = option.get_positional() ? "\\fI" + escape(option.get_name(true)) + "\\fR" : "";
  for (const std::string& name : names_of(option)) names += (names.empty() ? "" : ", ") + bold(name);
  const std::string placeholder = value_of(option).placeholder;
  return option.get_positional() || placeholder.empty() ? names : names + " \\fI" + escape(placeholder) + "\\fR";
}

std::string section_of(const CLI::App& command) {
  std::string text = fmt::format(".SS {}\n{}.\n", escape(usage_of(command)), escape(command.get_description()));
  for (const CLI::Option* option : positionals_of(command)) text += entry(heading_of(*option), description_of(*option));
  for (const CLI::Option* option : options_of(command))
    if (!option->get_positional() && option != command.get_help_ptr())
      text += entry(heading_of(*option), description_of(*option));
  return text;
}

}  // namespace

std::string man_page(const CLI::App& program) {
  std::string page = fmt::format(
      ".\\\" Made by `cairn help --man`.\n.TH CAIRN 1 {} \"Cairn {}\" \"User Commands\"\n"
      ".SH NAME\ncairn \\- dense RGB\\-D mapping\n"
      ".SH SYNOPSIS\n{}\n"
      ".SH DESCRIPTION\n{}\n"
      ".PP\nEach command also prints its options with {}.\n"
      ".SH COMMANDS\n",
      CAIRN_DATE, CAIRN_VERSION, bold(usage_of(program)), escape(program.get_description()), bold("--help"));
  for_each_command(program, [&](const CLI::App& command) {
    if (commands_of(command).empty()) page += section_of(command);
  });
  page += ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : kExitCodes) page += entry(bold(code), meaning);
  page += ".SH ENVIRONMENT\n";
  page += entry(bold("NO_COLOR"), "If set, the output is not colored.");
  page += entry(bold("TERM"), "With dumb, progress is printed in separate lines.");
  page += entry(bold("XDG_CACHE_HOME"), "Folder for compiled kernels, in cairn/ [~/.cache]");
  page += ".SH EXAMPLES\n";
  for (const auto& [command_line, meaning] : kExamples) page += entry(bold(command_line), meaning);
  return page;
}

}  // namespace cairn::apps
