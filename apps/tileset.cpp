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
#include "plan_info.hpp"
#include "run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path plan, output;
  bool json = false;
};

void write_it(const Arguments& a) {
  Inputs inputs;
  inputs.add_map(a.plan);
  for (const auto& [x, y, z] : cells_of(a.plan)) inputs.add(a.plan / "tiles" / fmt::format("{},{},{}", x, y, z));
  inputs.expect_apart_from_file(a.output);
  inputs.expect_apart_from_folder(fs::path(a.output).replace_extension(".tiles"));
  const int cells = write_cells_tileset(a.plan, a.output);
  if (a.json)
    fmt::print("{}\n", text_of({{"file", a.output.string()}, {"cells", cells}}, 2));
  else
    say("{}  {} cells\n", a.output.string(), cells);
  if (const auto joined = joined_parts(a.plan)) {
    const Verdict verdict = verdict_of(read_plan(a.plan), *joined);
    if (!a.json || verdict.level != Verdict::Level::good) print(verdict, a.json ? stderr : stdout);
  }
  if (!a.json) say("next: {}\n", next_of_plan(a.plan));
}

}  // namespace

void add_tileset(CLI::App& program) {
  auto* command = program.add_subcommand("tileset", "Put the cells of a plan's map under one tileset");
  const auto a = std::make_shared<Arguments>();
  command->add_option("PLAN", a->plan, "Folder of a plan whose cells tile has made, in PLAN/tiles")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("-o,--output", a->output, "File tileset.json (3D Tiles 1.1), which leads to those of the cells")
      ->required()
      ->type_name(kFile);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { write_it(*a); });
}

}  // namespace cairn::apps
