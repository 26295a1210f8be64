// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "cairn/building/project.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"
#include "cli/quantity.hpp"

namespace cairn::apps {
namespace {

struct Arguments {
  std::filesystem::path first, second, output;
  int device = -1;
  bool json = false;
};

void match(const Arguments& a) {
  Inputs().add_map(a.first).add_map(a.second).check_output_file(a.output);
  const MatchedMaps matched = match_maps(a.first, a.second, a.output, a.device);
  if (a.json)
    fmt::print("{}\n",
               format_json({{"file", a.output.string()}, {"compared", matched.compared}, {"loops", matched.loops}}, 2));
  else
    print_result("{}  {} of {} keyframes match the other map\n", a.output.string(), matched.loops, matched.compared);
}

}  // namespace

void add_match(CLI::App& program) {
  auto* command = program.add_subcommand("match", "Find loop closures between two maps");
  const auto a = std::make_shared<Arguments>();
  command->add_option("FIRST", a->first, "Folder written by reconstruct, with its session; it is not changed")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("SECOND", a->second, "The same; its keyframes are searched in the first map")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("-o,--output", a->output, "File X.json for the loop closures; in a project PLAN/loops/A-B.json")
      ->required()
      ->type_name(kFile);
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { match(*a); });
}

}  // namespace cairn::apps
