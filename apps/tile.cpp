// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <memory>

#include "cairn/parts.hpp"
#include "cell_option.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "export_options.hpp"
#include "inputs_and_outputs.hpp"
#include "json_text.hpp"
#include "outputs.hpp"
#include "progress.hpp"
#include "quantity.hpp"

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
  Inputs().add_map(a.plan).expect_apart_from_folder(a.output);
  Progress progress(std::nullopt, "");
  const Exported e = with_texture_if_any(a.options, a.output / "tileset.json", [&](const ExportOptions& options) {
    return export_cell(a.plan, a.cell, a.output, options, on(progress), a.device);
  });
  progress.clear();
  if (a.json) {
    fmt::print("{}\n", text_of(to_json(e), 2));
    return;
  }
  say("{}  {} triangles in {} tiles\n", (a.output / "tileset.json").string(), count_in_words(e.triangles), e.tiles);
}

}  // namespace

void add_tile(CLI::App& program) {
  auto* command = program.add_subcommand("tile", "Make one cell of a plan's map: its surface and voxels");
  const auto a = std::make_shared<Arguments>();
  command->add_option("PLAN", a->plan, "Folder of a plan that optimise has been run on")
      ->required()
      ->check(CLI::ExistingDirectory);
  add_cell(
      *command, [a](const std::array<int, 3>& cell) { a->cell = cell; },
      "X,Y,Z as PLAN/cells names it: 128 bricks of 8 voxels a side, 10.24 m at 1 cm")
      ->required();
  command
      ->add_option("-o,--output", a->output,
                   "Folder for tileset.json with its tiles, and map.vdb; of a plan PLAN/tiles/X,Y,Z")
      ->required()
      ->type_name(kFolder);
  add_export_options(*command, a->options);
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print the result to stdout as JSON");
  command->callback([a] { make_tile(*a); });
}

}  // namespace cairn::apps
