// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <array>
#include <memory>

#include "command_tree.hpp"
#include "commands.hpp"
#include "help.hpp"

namespace cairn::apps {

std::string first_words(int columns) {
  constexpr std::array<std::array<const char*, 3>, 5> kFirst{
      {{"try this", "cairn demo", "to a page in under a minute"},
       {"your recording", "cairn reconstruct FOLDER -o OUT", "cairn view OUT shows it"},
       {"your sensor", "cairn live openni: -o OUT --view", "watch the map grow"},
       {"this machine", "cairn doctor", "what it lacks"},
       {"help", "cairn help", "commands and their options"}}};
  constexpr int kAll = 78, kTwo = 48;  // columns
  std::string text;
  for (const auto& [what, command, words] : kFirst)
    text += columns >= kAll   ? fmt::format("{:<15} {:<34} {}\n", what, command, words)
            : columns >= kTwo ? fmt::format("{:<15} {}\n", what, command)
                              : fmt::format("{}\n", command);
  return text;
}

void add_help(CLI::App& program) {
  auto* command = program.add_subcommand("help", "Tell what a command does, like --help behind it");
  const auto words = std::make_shared<std::vector<std::string>>();
  const auto as_man_page = std::make_shared<bool>(false);
  command->add_option("COMMAND", *words, "Its name [all of them]")->expected(0, 2);
  command->add_flag("--man", *as_man_page, "Print the manual page of the whole program, for man -l");
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
