// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <memory>

#include "command_tree.hpp"
#include "commands.hpp"
#include "help.hpp"

namespace cairn::apps {

std::string first_words() {
  return "try this        cairn demo                         a synthetic room becomes a map and a page, in a minute\n"
         "your recording  cairn reconstruct FOLDER -o OUT    then cairn view OUT shows the map\n"
         "your sensor     cairn live openni: -o OUT --view   the map grows in a browser while you move\n"
         "this machine    cairn doctor                       what is missing, and what to install\n"
         "help            cairn help                         all commands; cairn help COMMAND: all its options\n";
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
    fmt::print("{}", command_in(program, *words).help());
  });
}

}  // namespace cairn::apps
