// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <memory>

#include "cairn/building/project.hpp"
#include "cli/cell_option.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/export_options.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/json_text.hpp"
#include "cli/outputs.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path plan, output;
  std::array<int, 3> cell{};
  MeshArguments options;
  int device = -1;
  bool json = false;
};

void make_tile(const Arguments& a) {
  Inputs().add_map(a.plan).check_output_folder(a.output);
  Progress progress(std::nullopt, "");
  const ExportReport e = with_texture_if_any(a.options, a.output / "tileset.json", [&](const ExportOptions& options) {
    return export_cell(a.plan, a.cell, a.output, options, export_progress(progress), a.device);
  });
  progress.clear();
  if (a.json) {
    fmt::print("{}\n", format_json(to_json(e), 2));
    return;
  }
  print_result("{}  {} triangles in {} tiles\n", (a.output / "tileset.json").string(), format_count(e.triangles),
               e.tiles);
}

}  // namespace

void add_tile(CLI::App& program) {
  auto* command = program.add_subcommand("tile", "Build one cell of a project's map: its surface and voxels");
  const auto a = std::make_shared<Arguments>();
  command->add_option("PLAN", a->plan, "Folder of a project after optimize")->required()->check(CLI::ExistingDirectory);
  add_cell(
      *command, [a](const std::array<int, 3>& cell) { a->cell = cell; },
      "X,Y,Z as in PLAN/cells: 128 bricks of 8 voxels a side, 10.24 m at 1 cm")
      ->required();
  command
      ->add_option("-o,--output", a->output,
                   "Folder for tileset.json with its tiles, and map.vdb; in a project PLAN/tiles/X,Y,Z")
      ->required()
      ->type_name(kFolder);
  add_export_options(*command, a->options);
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { make_tile(*a); });
}

}  // namespace cairn::apps
