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
#include "cli/plan_info.hpp"
#include "cli/run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path plan, output;
  bool json = false;
};

void write_tileset(const Arguments& a) {
  Inputs inputs;
  inputs.add_map(a.plan);
  for (const auto& [x, y, z] : cells_of(a.plan)) inputs.add(a.plan / "tiles" / fmt::format("{},{},{}", x, y, z));
  inputs.check_output_file(a.output);
  inputs.check_output_folder(fs::path(a.output).replace_extension(".tiles"));
  const int cells = write_cells_tileset(a.plan, a.output);
  if (a.json)
    fmt::print("{}\n", format_json({{"file", a.output.string()}, {"cells", cells}}, 2));
  else
    print_result("{}  {} cells\n", a.output.string(), cells);
  if (const auto joined = merged_segments(a.plan)) {
    const Verdict verdict = verdict_of(read_plan(a.plan), *joined);
    if (!a.json || verdict.level != Verdict::Level::good) print(verdict, a.json ? stderr : stdout);
  }
  if (!a.json) print_result("next: {}\n", next_project_command(a.plan));
}

}  // namespace

void add_tileset(CLI::App& program) {
  auto* command = program.add_subcommand("tileset", "Combine the cells of a project's map in one tileset");
  const auto a = std::make_shared<Arguments>();
  command->add_option("PLAN", a->plan, "Folder of a project with its cells built by tile, in PLAN/tiles")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("-o,--output", a->output, "File tileset.json (3D Tiles 1.1), which references those of the cells")
      ->required()
      ->type_name(kFile);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { write_tileset(*a); });
}

}  // namespace cairn::apps
