// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "cairn/parts.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "inputs_and_outputs.hpp"
#include "json_text.hpp"
#include "quantity.hpp"

namespace cairn::apps {
namespace {

struct Arguments {
  std::filesystem::path first, second, output;
  int device = -1;
  bool json = false;
};

void match(const Arguments& a) {
  Inputs().add_map(a.first).add_map(a.second).expect_apart_from_file(a.output);
  const MatchedMaps matched = match_maps(a.first, a.second, a.output, a.device);
  if (a.json)
    fmt::print("{}\n",
               text_of({{"file", a.output.string()}, {"compared", matched.compared}, {"loops", matched.loops}}, 2));
  else
    say("{}  {} of {} keyframes see a place of the other map\n", a.output.string(), matched.loops, matched.compared);
}

}  // namespace

void add_match(CLI::App& program) {
  auto* command = program.add_subcommand("match", "Find where two maps see the same");
  const auto a = std::make_shared<Arguments>();
  command->add_option("FIRST", a->first, "Folder that reconstruct has made, with its session; it stays as it is")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("SECOND", a->second, "The same, whose keyframes are looked for in the first one")
      ->required()
      ->check(CLI::ExistingDirectory);
  command
      ->add_option("-o,--output", a->output, "File X.json for the loops between the two; of a plan PLAN/loops/A-B.json")
      ->required()
      ->type_name(kFile);
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { match(*a); });
}

}  // namespace cairn::apps
