// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <array>
#include <memory>

#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/help.hpp"

namespace cairn::apps {

std::string introduction(int columns) {
  constexpr std::array<std::array<const char*, 3>, 5> kLines{
      {{"try this", "cairn demo", "a map in under a minute"},
       {"your recording", "cairn reconstruct FOLDER -o OUT", "cairn view OUT shows it"},
       {"your sensor", "cairn live openni: -o OUT --view", "watch the map grow"},
       {"this machine", "cairn doctor", "shows what is missing"},
       {"help", "cairn help", "commands and their options"}}};
  constexpr int kThreeColumns = 78, kTwoColumns = 48;  // columns
  std::string text;
  for (const auto& [what, command, words] : kLines)
    text += columns >= kThreeColumns ? fmt::format("{:<15} {:<34} {}\n", what, command, words)
            : columns >= kTwoColumns ? fmt::format("{:<15} {}\n", what, command)
                                     : fmt::format("{}\n", command);
  return text;
}

void add_help(CLI::App& program) {
  auto* command = program.add_subcommand("help", "Show the help of a command, like --help after it");
  const auto words = std::make_shared<std::vector<std::string>>();
  const auto as_man_page = std::make_shared<bool>(false);
  command->add_option("COMMAND", *words, "Name of the command [all]")->expected(0, 2);
  command->add_flag("--man", *as_man_page, "Print the manual page of the program, for man -l");
  command->callback([&program, words, as_man_page] {
    if (*as_man_page) {
      fmt::print("{}", man_page(program));
      return;
    }
    if (const auto unknown = unknown_word(program, *words)) {
      fmt::print(stderr, "{}\n", *unknown);
      throw CLI::RuntimeError(2);
    }
    // App::help() would print the help of the running command, `help`.
    fmt::print("{}", help_format()->make_help(&command_in(program, *words), "", CLI::AppFormatMode::Normal));
  });
}

}  // namespace cairn::apps
